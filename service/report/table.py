"""The report as a table for a terminal."""

from collections.abc import Iterable

from service.report.measure import Row

__all__ = ["table"]


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.2%}" if value < 10 else f"{value:.0f}x"


def table(rows: Iterable[Row]) -> str:
    """Return the report as text; a blank line divides scenes."""
    header = (
        f"{'technique':<36}{'frames':>8}{'single':>8}{'holds':>8}{'median':>9}{'90 %':>9}"
        f"{'us/frame':>12}  remark"
    )
    lines: list[str] = []
    scene = None
    for row in rows:
        if row.scene != scene:
            scene = row.scene
            lines += ["", f"scene: {scene}", header]
        lines.append(
            f"{row.technique:<36}{row.frames:>8}{row.answered:>8.0%}{row.holds_truth:>8.0%}"
            f"{_percent(row.median_error):>9}{_percent(row.p90_error):>9}"
            f"{row.frame_s * 1e6:>12.3g}  {row.remark}".rstrip()
        )
    legend = (
        "single: share of frames with one range; holds: share in which a root within two standard "
        "deviations,\nor the posterior's 90 % interval, has the truth; median, 90 %: quantiles of "
        "the relative error of single ranges"
    )
    return "\n".join([*lines, "", legend, ""])
