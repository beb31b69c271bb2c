"""The command line: it parses, hands over to `pbrl_bringup.commands`, and turns mistakes into one line.

Exit codes: 0 done; 1 a fault of ours, or tests that fail; 2 something the person can mend; 130 Ctrl-C.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer
from typer.exceptions import TyperException

from pbrl_bringup.cli.errors import complain, complain_of
from pbrl_bringup.cli.handing import hand_over
from pbrl_bringup.cli.learning import diagnose, fit
from pbrl_bringup.cli.measuring import bench, cluster, experiment
from pbrl_bringup.cli.options import (
    Bag,
    Diagnosis,
    Domain,
    Form,
    Many,
    Mapping,
    Models,
    Namespace,
    Opened,
    Out,
    Port,
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


@app.command(epilog="Example: ./pbrl demo --seed 3 --out out/demo")
def demo(
    out: Out = Path("out/demo"),
    seed: Seed = 0,
    gui: Annotated[
        bool | None, typer.Option("--gui/--headless", help="Bullet's window, or none. Default: none without a display.")
    ] = None,
) -> int:
    """Push a table with a locked caster, learn from the recording, show it on a page."""
    return hand_over("demo", out=out, seed=seed, gui=gui)


@app.command(context_settings=Many, epilog="Example: ./pbrl test -- -k kernel -x")
def test(context: typer.Context) -> int:
    """Check style and types, then run every test; further arguments go to pytest."""
    return hand_over("test", arguments=context.args)


app.command(epilog="Example: ./pbrl fit out/demo/bag --out out/fit")(fit)


app.command(epilog="Example: ./pbrl diagnose out/demo/bag --baseline wheel+ground --out out/diagnose")(diagnose)


@app.command(epilog="Example: ./pbrl simulate locked_caster --push turn_table --seed 2 --out out/push")
def simulate(
    scene: Annotated[str, typer.Argument(help="Scene file, or a name in config/scenes.")],
    out: Annotated[Path, typer.Option(help="Bag folder to make; it must not exist yet.")],
    push: Annotated[str, typer.Option(help="Push plan, or a name in config/params/pushes.")] = "turn_table",
    seed: Seed = 0,
    gui: Annotated[bool, typer.Option("--gui", help="Open Bullet's window.")] = False,
) -> int:
    """Simulate a push and record it, faster than real time, without ROS processes."""
    return hand_over("simulate", scene=scene, push=push, seed=seed, out=out, gui=gui)


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
    return hand_over("run", graph=graph, **chosen, domain=domain, logs=logs)


@app.command(epilog="Example: ./pbrl record --out out/push.bag")
def record(
    out: Annotated[Path, typer.Option(help="Bag folder to make; it must not exist yet.")],
    duration: Annotated[float, typer.Option(min=0, max=1e9, help="Seconds to record; 0: until Ctrl-C.")] = 0.0,
    namespace: Namespace = "",
    domain: Domain = None,
) -> int:
    """Record the topics of a running graph or robot."""
    return hand_over("record", out=out, duration=duration, namespace=namespace, domain=domain)


@app.command(epilog="Example: ./pbrl play out/push.bag --rate 2")
def play(
    bag: Annotated[Path, typer.Argument(help="Bag folder or .mcap file.")],
    rate: Annotated[float, typer.Option(min=0.01, max=1000, help="Times faster than it was recorded.")] = 1.0,
    namespace: Namespace = "",
    domain: Domain = None,
) -> int:
    """Publish a recording again."""
    return hand_over("play", bag=bag, rate=rate, namespace=namespace, domain=domain)


@app.command(epilog="Example: ./pbrl info out/push.bag")
def info(bag: Bag, mapping: Mapping = None) -> int:
    """Say what a recording holds: topics, rates, objects, grasps."""
    return hand_over("info", bag=bag, mapping=mapping)


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
    return hand_over(
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
    return hand_over("map", bag=bag, out=out, sizes=size or [])


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
    return hand_over("export", model=model, form=str(form), out=out, height=height, only=only)


app.command(epilog="Example: ./pbrl bench wheel --quick")(bench)


app.command(epilog="Example: ./pbrl experiment sample-efficiency --quick")(experiment)


app.command(epilog="Example: ./pbrl cluster --workers 2, then ./pbrl fit runs --scheduler tcp://127.0.0.1:8786")(
    cluster
)


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
