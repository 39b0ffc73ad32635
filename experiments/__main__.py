"""Command line: `python -m experiments NAME`; `--list` lists the names."""

import argparse
import os
import pathlib
import sys
import time
from collections.abc import Callable
from typing import Any

DEMO = "block-fig02"
PAGES = ("record", "results", "pictures")
WORTH = 0.1  # s of compiling from which a program is kept


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m experiments", description="Compute and draw the figures of the papers.",
        add_help=False,
    )  # fmt: skip
    parser.add_argument(
        "-h", "--help", action="store_true", dest="asks",
        help="this text, and for an experiment the keys of --set with their values",
    )  # fmt: skip
    parser.add_argument(
        "name",
        nargs="?",
        help="an experiment, 'all', 'demo', 'statements' for the scoreboard, 'record' to take the full "
        "runs over into the repository, 'results' to write experiments/RESULTS.md from them, "
        "'pictures' to draw those of README and pages",
    )
    parser.add_argument("--list", action="store_true", help="list the experiments and stop")
    parser.add_argument("--quick", action="store_true", help="coarse, for a first look")
    parser.add_argument("--out", default="results", metavar="DIR", help="directory to write to")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="changes",
        help="change a parameter; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--fresh", action="store_true", help="compute everything again, also what is stored"
    )
    parser.add_argument(
        "--data", metavar="PATH", type=pathlib.Path,
        help="folder of measured records, by default $STICKSLIP_DATA; or a file of your own",
    )  # fmt: skip
    parser.add_argument(
        "--template", metavar="FILE", type=pathlib.Path,
        help="write an example of such a file, and stop",
    )  # fmt: skip
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; the exit status."""
    parser = _parser()
    options = parser.parse_args(arguments)
    if options.asks and options.name is None:
        parser.print_help()
        return 0
    from . import _experiment
    from ._experiment import chosen
    from ._scoreboard import scoreboard

    out = pathlib.Path(options.out)
    if options.name == "statements":
        if not out.is_dir():
            print(f"--out {out}: it must be a directory of results.", file=sys.stderr)
            return 2
        print(scoreboard(out))
        return 0
    experiments = _experiment.load()
    if options.name in PAGES:
        return _keep_or_write(options.name, experiments, out)
    if options.list or options.name is None:
        print(f"{'demo':<14} {experiments[DEMO].title}: the paper's protocol alone")
        for name, experiment in experiments.items():
            print(f"{name:<14} {experiment.title}")
        return 0
    if options.name not in (*experiments, "all", "demo"):
        print(
            f"{options.name!r} is not an experiment; known: demo, all, statements, {', '.join(PAGES)}, "
            f"{', '.join(experiments)}.",
            file=sys.stderr,
        )
        return 2
    if options.asks:
        parser.print_help()
        _print_keys(options.name, experiments)
        return 0
    if options.name == "all" and options.changes:
        print("--set changes one experiment: name it instead of 'all'.", file=sys.stderr)
        return 2
    names = list(experiments) if options.name == "all" else [options.name]
    if options.template is not None:
        return _write_template(experiments, options)
    if options.data is not None and options.data.is_file():
        taken = experiments.get(options.name)
        if taken is None or taken.measured is None:
            takers = ", ".join(name for name, e in experiments.items() if e.measured is not None)
            print(
                f"--data {options.data}: it must be a folder; files are taken by {takers}.",
                file=sys.stderr,
            )
            return 2
        experiments[options.name] = taken.measured
    # A wrong --set is refused before the engine is loaded or anything is compiled.
    try:
        for name in names:
            chosen(experiments[DEMO if name == "demo" else name], options.quick, options.changes)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    _keep_compiled()
    failed = []
    for name in names:
        if not _run_one(name, experiments, options, out):
            failed.append(name)
    if failed and len(names) > 1:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def _print_keys(name: str, experiments) -> None:
    """The keys of `--set` of an experiment, at full resolution and with `--quick`."""
    from ._settings import choices_of

    experiment = experiments.get(DEMO if name == "demo" else name)
    if experiment is None:  # all of them
        return
    kinds = [("", experiment)]
    if experiment.measured is not None:
        kinds.append((" with --data FILE", experiment.measured))
    print(f"\n{name}: {experiment.title}")
    for when, kind in kinds:
        print(f"keys of --set{when}:")
        for key, value in kind.parameters.items():
            text = f"  {key}={value}" + (
                f", with --quick {kind.quick[key]}" if key in kind.quick else ""
            )
            print(text + (f"; one of {', '.join(given)}" if (given := choices_of(key)) else ""))


def _keep_or_write(name: str, experiments, out: pathlib.Path) -> int:
    from ._records import keep, read
    from ._results_page import write

    if name == "pictures":
        from ._pictures import write as draw

        for path in draw(out):
            print(f"  wrote {path}")
        return 0
    if name == "record":
        if not out.is_dir():
            print(f"--out {out}: it must be a directory of results.", file=sys.stderr)
            return 2
        taken, left = keep(out, experiments)
        for text in left:
            print(f"left out: {text}")
        print(f"taken over: {', '.join(taken) or 'nothing'}")
    for path in write(read(), experiments):
        print(f"  wrote {path}")
    return 0


def _write_template(experiments, options) -> int:
    taken = experiments.get(options.name)
    if taken is None or taken.measured is None or taken.measured.template is None:
        takers = ", ".join(
            name for name, e in experiments.items() if e.measured and e.measured.template
        )
        print(f"--template {options.template}: only for {takers}.", file=sys.stderr)
        return 2
    if options.template.exists():
        print(f"--template {options.template}: it exists, and is not written over.", file=sys.stderr)
        return 2
    _keep_compiled()
    for path in taken.measured.template(options.template):
        print(f"  wrote {path}")
    return 0


def _run_one(name: str, experiments, options, out: pathlib.Path) -> bool:
    import dataclasses

    from stickslip.sweep import SweepMismatchError, SweepWriteError

    from ._data import MissingDataError
    from ._experiment import chosen
    from ._output import run, same_run

    experiment = experiments[DEMO if name == "demo" else name]
    changes = list(options.changes)
    if name == "demo":
        title = "a block that sticks and slips on a belt, over the stiffness of its spring"
        experiment = dataclasses.replace(
            experiment, name="demo", title=title, draw=_in_plain_words(experiment.draw)
        )
        changes = ["converged_duration=0", "exponents=0", *changes]
    record = out / f"{experiment.name}.json"
    parameters = chosen(experiment, options.quick, changes)
    if options.name == "all" and not options.fresh and same_run(record, parameters):
        print(f"{name}: done before, see {record}")
        return True
    begin = time.monotonic()
    print(f"{name}: {experiment.title}", flush=True)
    try:
        files = run(
            experiment, out, quick=options.quick, changes=changes, fresh=options.fresh,
            data=options.data,
        )  # fmt: skip
    except MissingDataError as error:
        print(error, file=sys.stderr)
        # Figures that need no records are not held up by those that do.
        return options.name == "all"
    except SweepMismatchError as error:
        text = str(error).partition("Use another store")[0]
        print(f"{text}Choose another --out, or compute anew with --fresh.", file=sys.stderr)
        return False
    except (SweepWriteError, ValueError) as error:
        print(error, file=sys.stderr)
        return False
    for path in files:
        print(f"  wrote {path}")
    print(f"  {time.monotonic() - begin:.1f} s")
    if name == "demo":
        data = next(path for path in files if path.suffix == ".nc")
        print(
            f"In the browser, with the motion behind every point:\n"
            f"  .venv/bin/python -m stickslip view {data} --with experiments.block.view\n"
            "Next: notebooks/getting_started.py, or `.venv/bin/python -m experiments --list`."
        )
    return True


def _in_plain_words(draw: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """The picture of the diagram for those who have not read the paper."""

    def drawn(dataset: Any) -> Any:
        text = (
            "Each dot is where the block is at a moment when its acceleration falls through zero, from "
            f"{float(dataset.transient[0]):g} s after the start on. Where a branch of dots splits into "
            "two, the period of the motion doubles; a cloud is chaos, a streak has not settled. "
            "Parameters made up by us."
        )
        figure = draw(dataset.assign_attrs(caption=text))
        figure.axes[0].set_title("A block on a belt: where it period-doubles", fontsize=10)
        return figure

    return drawn


def _keep_compiled() -> None:
    """Keep compiled programs, so that a second call starts at once.

    In the user's cache: they are run as they are, and a folder of results may come from anybody. A
    folder that the user has named to JAX keeps the short ones too, as ours does.
    """
    if not os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        from stickslip import enable_compilation_cache

        enable_compilation_cache()
    elif "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS" not in os.environ:
        import jax

        # By itself JAX keeps what takes it a second: of the hundreds of programs of a fit a few.
        jax.config.update("jax_persistent_cache_min_compile_time_secs", WORTH)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt as interrupt:
        # A sweep says what it keeps.
        print(f"\n{interrupt}" if str(interrupt) else "\ninterrupted", file=sys.stderr)
        print("the same command goes on from here", file=sys.stderr)
        sys.exit(130)
