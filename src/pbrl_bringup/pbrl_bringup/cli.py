"""The command line: it parses, hands over to `pbrl_bringup.commands`, and turns mistakes into one line.

Exit codes: 0 done; 1 a fault of ours, or tests that fail; 2 something the person can mend; 130 Ctrl-C.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Annotated, Any

import typer
from typer.exceptions import TyperException

from pbrl_bringup.cli_errors import complain, complain_of
from pbrl_bringup.cli_options import (
    Bag,
    Diagnosis,
    Domain,
    Draws,
    Engine,
    Form,
    Likelihood,
    Many,
    Mapping,
    Models,
    Namespace,
    Opened,
    Out,
    Port,
    Quick,
    Sampler,
    Seed,
)

STOPPED = 130  # what Ctrl-C ends with; typer itself turns it into this code

app = typer.Typer(
    name="pbrl",
    help="A robot pushes things whose physics it does not know, and learns a model of each from the recording.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _hand_over(command: str, **arguments: Any) -> int:
    """Run `pbrl_bringup.commands.<command>.command`, imported only now: what it needs may be heavy."""
    return int(import_module(f"pbrl_bringup.commands.{command}").command(**arguments))


@app.command(epilog="Example: ./pbrl demo --seed 3 --out out/demo")
def demo(
    out: Out = Path("out/demo"),
    seed: Seed = 0,
    gui: Annotated[
        bool | None, typer.Option("--gui/--headless", help="Bullet's window, or none. Default: none without a display.")
    ] = None,
) -> int:
    """Push a table with a locked caster, learn from the recording, show it on a page."""
    return _hand_over("demo", out=out, seed=seed, gui=gui)


@app.command(context_settings=Many, epilog="Example: ./pbrl test -- -k kernel -x")
def test(context: typer.Context) -> int:
    """Check style and types, then run every test; further arguments go to pytest."""
    return _hand_over("test", arguments=context.args)


@app.command(epilog="Example: ./pbrl fit out/demo/bag --out out/fit")
def fit(
    bag: Bag,
    mapping: Mapping = None,
    out: Out = Path("out/fit"),
    model_class: Annotated[
        str,
        typer.Option(
            help="free, wheel, wheel+ground or hinge; auto: hinge where only a point of the body was seen, "
            "else wheel+ground (a wheel, and friction of the whole body on the floor)."
        ),
    ] = "auto",
    likelihood: Annotated[Likelihood, typer.Option(help="How motion is compared.")] = Likelihood.WINDOWED,
    sampler: Annotated[
        Sampler,
        typer.Option(help="importance: every mode, with an evidence; metropolis: block-wise chains, the thesis's way."),
    ] = Sampler.IMPORTANCE,
    engine: Annotated[
        Engine, typer.Option(help="What simulates: the compiled kernel, or pymunk, the thesis's way and far slower.")
    ] = Engine.KERNEL,
    draws: Draws = None,
    priors: Annotated[
        Path | None, typer.Option(help="YAML file of priors, as config/params/priors.yaml. Default: what stands there.")
    ] = None,
    seed: Seed = 0,
) -> int:
    """Learn the physics of every object that was pushed in a recording."""
    return _hand_over(
        "fit",
        bag=bag,
        mapping=mapping,
        out=out,
        model_class=model_class,
        likelihood=str(likelihood),
        sampler=str(sampler),
        engine=str(engine),
        draws=draws,
        priors=priors,
        seed=seed,
    )


@app.command(epilog="Example: ./pbrl diagnose out/demo/bag --baseline wheel+ground --out out/diagnose")
def diagnose(
    bag: Bag,
    mapping: Mapping = None,
    out: Out = Path("out/diagnose"),
    baseline: Annotated[
        list[str] | None,
        typer.Option(
            help="What is no mismatch: free, caster (one that is locked), wheel, ground, wheel+ground or hinge; as "
            "often as needed, the best counts. Default: free, caster and wheel."
        ),
    ] = None,
    without: Annotated[
        list[str] | None, typer.Option(help="An effect that the library does without, as often as needed.")
    ] = None,
    effects: Annotated[
        list[Path] | None,
        typer.Option(help="Python file that adds effects of one's own (docs/mismatch.md), as often as needed."),
    ] = None,
    mass_spread: Annotated[
        float | None,
        typer.Option(help="How well the mass that was told is known: 0.2 is to 20 %. Default: 0.1."),
    ] = None,
    grasp_spread: Annotated[
        float | None,
        typer.Option(help="How well the gripper's direction is known [rad]. Default: 0, exactly."),
    ] = None,
    outline_spread: Annotated[
        float | None,
        typer.Option(help="How well each side of the outline is known [m]. Default: 0, exactly."),
    ] = None,
    seed: Seed = 0,
    workers: Annotated[
        int, typer.Option(min=1, max=256, help="Threads; the result does not depend on their number.")
    ] = 2,
) -> int:
    """Say where recording and model part, what physics was left out, and show that the repair predicts better."""
    return _hand_over(
        "diagnose",
        bag=bag,
        mapping=mapping,
        out=out,
        baseline=baseline or [],
        without=without or [],
        effects=effects or [],
        known={"mass_spread": mass_spread, "grasp_spread": grasp_spread, "outline_spread": outline_spread},
        seed=seed,
        workers=workers,
    )


@app.command(epilog="Example: ./pbrl simulate locked_caster --push turn_table --seed 2 --out out/push")
def simulate(
    scene: Annotated[str, typer.Argument(help="Scene file, or a name in config/scenes.")],
    out: Annotated[Path, typer.Option(help="Bag folder to make; it must not exist yet.")],
    push: Annotated[str, typer.Option(help="Push plan, or a name in config/params/pushes.")] = "turn_table",
    seed: Seed = 0,
    gui: Annotated[bool, typer.Option("--gui", help="Open Bullet's window.")] = False,
) -> int:
    """Simulate a push and record it, faster than real time, without ROS processes."""
    return _hand_over("simulate", scene=scene, push=push, seed=seed, out=out, gui=gui)


@app.command(epilog="Example: ./pbrl run krang_push --set sim.scene=three_tables --with recorder")
def run(
    graph: Annotated[str, typer.Argument(help="Graph file, or a name in config/params/graphs.")],
    set_: Annotated[list[str] | None, typer.Option("--set", help="NODE.PARAMETER=VALUE, as often as needed.")] = None,
    with_: Annotated[list[str] | None, typer.Option("--with", help="An optional node to start too.")] = None,
    namespace: Namespace = "",
    domain: Domain = None,
    logs: Annotated[Path, typer.Option(help="Folder for the nodes' output.")] = Path("out/logs"),
) -> int:
    """Start a graph of nodes and keep it until Ctrl-C."""
    chosen = {"settings": set_ or [], "optional": with_ or [], "namespace": namespace}
    return _hand_over("run", graph=graph, **chosen, domain=domain, logs=logs)


@app.command(epilog="Example: ./pbrl record --out out/push.bag")
def record(
    out: Annotated[Path, typer.Option(help="Bag folder to make; it must not exist yet.")],
    duration: Annotated[float, typer.Option(min=0, max=1e9, help="Seconds to record; 0: until Ctrl-C.")] = 0.0,
    namespace: Namespace = "",
    domain: Domain = None,
) -> int:
    """Record the topics of a running graph or robot."""
    return _hand_over("record", out=out, duration=duration, namespace=namespace, domain=domain)


@app.command(epilog="Example: ./pbrl play out/push.bag --rate 2")
def play(
    bag: Annotated[Path, typer.Argument(help="Bag folder or .mcap file.")],
    rate: Annotated[float, typer.Option(min=0.01, max=1000, help="Times faster than it was recorded.")] = 1.0,
    namespace: Namespace = "",
    domain: Domain = None,
) -> int:
    """Publish a recording again."""
    return _hand_over("play", bag=bag, rate=rate, namespace=namespace, domain=domain)


@app.command(epilog="Example: ./pbrl info out/push.bag")
def info(bag: Bag, mapping: Mapping = None) -> int:
    """Say what a recording holds: topics, rates, objects, grasps."""
    return _hand_over("info", bag=bag, mapping=mapping)


@app.command(epilog="Example: ./pbrl view out/demo/bag --model out/fit/posterior_table_a.nc")
def view(
    what: Annotated[
        str, typer.Argument(metavar="[BAG|live]", help="A recording as for fit, or live: the running graph.")
    ] = "live",
    mapping: Mapping = None,
    model: Models = None,
    report: Diagnosis = None,
    port: Port = None,
    opened: Opened = None,
    namespace: Namespace = "",
    domain: Domain = None,
) -> int:
    """Show a recording or a running graph on a page of this machine: top view, forces, models, time."""
    return _hand_over(
        "view",
        what=what,
        mapping=mapping,
        models=model or [],
        report=report,
        port=port,
        opened=opened,
        namespace=namespace,
        domain=domain,
    )


@app.command("map", epilog="Example: ./pbrl map out/foreign --size table=1.2x0.8 --out mapping.yaml")
def map_bag(
    bag: Annotated[Path, typer.Argument(help="Bag folder, .mcap, .db3 or .bag file.")],
    out: Annotated[Path, typer.Option(help="Mapping file to write; never one that is there.")] = Path("mapping.yaml"),
    size: Annotated[
        list[str] | None,
        typer.Option(help="Length and width of a body [m], NAME=1.2x0.8; as often as there are bodies."),
    ] = None,
) -> int:
    """Propose which stream of a foreign bag plays which role, with reasons, as a mapping file."""
    return _hand_over("map", bag=bag, out=out, sizes=size or [])


@app.command(epilog="Example: ./pbrl export out/fit --format urdf --out out/table.urdf")
def export(
    model: Annotated[Path, typer.Argument(help="model_NAME.json, or the folder of a fit or a diagnosis.")],
    form: Annotated[
        Form, typer.Option("--format", help="urdf, sdf, json (with its schema beside it) or netcdf (ArviZ).")
    ] = Form.JSON,
    out: Annotated[Path | None, typer.Option(help="File to write. Default: the object's name, here.")] = None,
    height: Annotated[
        float, typer.Option(min=0.05, max=100.0, help="Of the body [m], for urdf and sdf; pushing does not tell it.")
    ] = 0.75,
    only: Annotated[str | None, typer.Option("--object", help="Which one, where a folder has several.")] = None,
) -> int:
    """Write a learned object in the words of other stacks: inertia, friction, and how sure they are."""
    return _hand_over("export", model=model, form=str(form), out=out, height=height, only=only)


@app.command(epilog="Example: ./pbrl bench wheel --quick")
def bench(
    name: Annotated[
        str,
        typer.Argument(
            help="sim, wheel, cabinet, recorder, mcap, kernel, inference, pose, calibration, concealed, "
            "tags, control, next-experiment, view, mismatch or fuzz."
        ),
    ],
    out: Annotated[Path | None, typer.Option(help="Folder for report.json. Default: out/bench/NAME.")] = None,
    seed: Seed = 0,
    quick: Quick = False,
    sets: Annotated[
        str | None,
        typer.Option(
            help="Sets of cases of the bench concealed, with commas: clean, single, pairs, withheld, furnished, rough. "
            "Of the bench fuzz: names of readers and nodes. Default: all."
        ),
    ] = None,
    most: Annotated[
        int | None, typer.Option(min=1, help="Recordings an effect at most, and ten times clean ones; hostile inputs.")
    ] = None,
    minutes: Annotated[
        float | None, typer.Option(min=0.0, help="After which no case is begun; what there is is reported.")
    ] = None,
) -> int:
    """Measure one group of acceptance rows; the last line is the report as JSON."""
    wanted = [each.strip() for each in sets.split(",")] if sets is not None else []
    return _hand_over("bench", name=name, out=out, seed=seed, quick=quick, sets=wanted, most=most, minutes=minutes)


@app.command(epilog="Example: ./pbrl experiment sample-efficiency --quick")
def experiment(
    name: Annotated[
        str,
        typer.Argument(
            help="shopping-cart, shopping-cart-noisy, apartment, sample-efficiency, noise, robot-fits, limits or "
            "contact."
        ),
    ],
    out: Annotated[Path | None, typer.Option(help="Folder for report.json. Default: out/experiment/NAME.")] = None,
    seed: Seed = 0,
    quick: Quick = False,
) -> int:
    """Repeat an experiment of the thesis; figure.png in the folder, the last line is the report as JSON."""
    return _hand_over("experiment", name=name, out=out, seed=seed, quick=quick)


def main() -> None:
    """Run the command line of this process and exit with its code."""
    signal.signal(signal.SIGTERM, _leave)
    # A shell starts what it puts in the background deaf to Ctrl-C, and every process below it would inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(run_arguments(sys.argv[1:]))


def run_arguments(arguments: Sequence[str]) -> int:
    """Run one command and return its exit code; every error ends here, as one line on stderr."""
    try:
        code = int(app(args=list(arguments) or ["--help"], prog_name="pbrl", standalone_mode=False) or 0)
        return complain("stopped", STOPPED) if code == STOPPED else code
    except TyperException as error:
        return complain(" ".join(error.format_message().split()) or "see --help", 2)
    except KeyboardInterrupt:
        return complain("stopped", STOPPED)
    except Exception as error:
        return complain_of(error)


def _leave(number: int, frame: FrameType | None) -> None:
    """Let SIGTERM unwind the stack, so that every `with` stops what it started."""
    raise SystemExit(128 + number)
