"""`./pbrl experiment NAME`: repeat an experiment of the thesis, with its number beside ours."""

from __future__ import annotations

from pathlib import Path

from pbrl_bringup.commands.measured import run_measured

EXPERIMENTS = {
    "shopping-cart": "figure 23a: agents push a cart round a wall to a goal, without noise",
    "shopping-cart-noisy": "figure 23b: the same with noise on what is observed",
    "apartment": "figure 23c: eleven objects learned and moved to their places",
    "sample-efficiency": "figure 24: observations needed for ten household objects",
    "noise": "figure 26: accuracy against training size and against noise",
    "robot-fits": "figure 30: tables and a cart pushed by Krang, fitted three ways",
    "body-jacobian": "figures 36 to 38: one path with and without constraints known, with and without steering",
    "articulation": "chapter 4: a held table is turned about points of choice; the centre found, and how far it goes",
    "limits": "what a diagnosis cannot tell, each limit measured on a recording that shows it",
    "namo-static": "section 6.5.1: a table is stuck, which is learned; the other one is moved",
    "namo-wheel": "section 6.5.2: a locked caster is learned, the table turned about it",
    "namo-concealed": "a carpet, a tether or an unseen body in the way: who asks what was met, and who does not",
    "namo-scaling": "figures 34 and 35: time to plan among 5 to 80 movable obstacles",
    "cart-office": "section 4.6 and table 1: the PR2 pushes a cart through offices with people for an hour",
    "cart-turn": "figure 18: what robot and cart sweep in a turn by 90 degrees, with and without articulation",
    "cart-doors": "chapter 4: the narrowest doorways and corners that robot and cart get through, both ways",
    "displacement-models": "figure 2: what six pushes do to three items, learned, and compared with 200 more pushes",
    "tabletop-3": "figures 6 and 9: two plates and a platter are laid, with the descent of the objective and without",
    "tabletop-6": "figures 7 and 9: four plates and two platters are laid",
    "tabletop-models": "a desk is cleaned with tables of displacements, and with the world model after few pushes",
    "tabletop-obstacle": "figures 8 and 9: an eraser goes round a hole punch that must not be touched",
    "tabletop-clean": "figures 5 and 9: an arm straightens what lies on a desk",
    "contact": "section 6.5.3: a wheel found on a table that is only pushed by another",
}


def command(name: str, out: Path | None, seed: int, quick: bool, scheduler: str | None = None) -> int:
    """Run one experiment.

    Raises:
        BringupError: there is none of that name, or no such scheduler.
    """
    return run_measured("experiment", EXPERIMENTS, name, out, seed, quick, scheduler=scheduler)
