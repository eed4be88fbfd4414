"""``hybridtof convert``: registers of a sensor as frames."""

import argparse
from pathlib import Path

from service.commands.command import Subparsers, add_command, note

__all__ = ["add_parser"]


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "convert",
        _run,
        brief="frames from the registers of a sensor",
        description="Turn a dump of a sensor's registers into frames and a sensor with its noise, "
        "and print both as JSON. Which registers, in which order, stands in docs/adapters.md.",
        examples="""
            hybridtof convert isl29501 dump.hex --output frames.csv --document scene.json
            hybridtof convert opt3101 dump.bin --channel 1 --read 12 12 --period-s 0.033
            hybridtof convert afbr-s50 pixels.csv --frequency-hz 24e6 --output frames.ndjson
            hybridtof convert tmf882x histograms.json --readings pulsed --output frames.csv
        """,
    )
    parser.add_argument("sensor", help="isl29501, opt3101, afbr-s50 or tmf882x")
    parser.add_argument("dump", type=Path, help=".bin, .hex or .csv; of a tmf882x .json")
    parser.add_argument(
        "--read", type=float, nargs=2, metavar="SD", help="noise of the two readings"
    )
    parser.add_argument("--frequency-hz", type=float, help="modulation frequency [Hz]")
    parser.add_argument("--period-s", type=float, help="from frame to frame [s]")
    parser.add_argument(
        "--agc",
        choices=("linear", "compensated"),
        help="whether readings grow with the register of the automatic gain",
    )
    parser.add_argument("--channel", type=int, help="the emitter whose frames count")
    parser.add_argument(
        "--readings", help="iq or amplitude_phase (opt3101), pulsed or sine_wave (tmf882x)"
    )
    parser.add_argument("--output", type=Path, help="write the frames here too")
    parser.add_argument(
        "--document", type=Path, help="write the sensor here, with an empty scene to be completed"
    )


def _run(args: argparse.Namespace) -> int:
    import json

    from service.adapters import ADAPTERS
    from service.adapters.adapter import Settings, converted
    from service.commands.files import check_folder, naming, reading
    from service.commands.output import write_result
    from service.frame_files import check_suffix, write_frames
    from simulator.errors import InvalidInputError, Problem

    adapters = {adapter.name: adapter for adapter in ADAPTERS}
    if args.sensor not in adapters:
        raise InvalidInputError(Problem("sensor", f"must be {', '.join(adapters)}"))
    if args.output is not None:
        check_suffix(args.output.suffix, "written to")
        check_folder("--output", args.output)
    if args.document is not None:
        check_folder("--document", args.document)
    read = None if args.read is None else (args.read[0], args.read[1])
    settings = Settings(
        read, args.frequency_hz, args.period_s, args.agc, args.channel, args.readings
    )
    options = ("read", "frequency_hz", "period_s", "agc", "channel", "readings")
    sources = {f"/{name}": "--" + name.replace("_", "-") for name in options}
    with reading(args.dump), naming(sources):
        raw = args.dump.read_bytes()
        result = converted(adapters[args.sensor], raw, args.dump.suffix.lower(), settings)
    for line in result.notes:
        note(args, f"note: {line}")
    document = {
        "sensor": result.sensor.model_dump(mode="json", exclude_none=True),
        "scene": {},
    }
    if args.document is not None:
        args.document.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    if args.output is not None:
        write_frames(args.output, result.columns)
    whole = document | {"frames": dict(result.columns), "notes": list(result.notes)}
    write_result(json.dumps(whole, allow_nan=False).encode("ascii"))
    return 0
