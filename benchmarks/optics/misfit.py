"""How wrong the object parameter model is, by class of scene, as a table in Markdown.

Run: python -m benchmarks.optics.misfit
"""

from simulator.optics.misfit import measure


def main() -> None:
    print("| scenes | n | rms | mean | worst | correlation length in log r | worst at 1-2 m |")
    print("|---|---|---|---|---|---|---|")
    for row in measure():
        print(
            f"| {row.scene_class} | {row.scenes} | {row.rms:.2%} | {row.mean_absolute:.2%} "
            f"| {row.worst:.1%} | {row.correlation_length:.2f} | {row.extrapolated:.1%} |"
        )


if __name__ == "__main__":
    main()
