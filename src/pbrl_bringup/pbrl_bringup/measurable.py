"""What can be measured, benches and experiments, with a sentence on each: for the command line and its help."""

from __future__ import annotations

BENCHES = {
    "sim": "a pushed table against a hand calculation, kinematics, speed",
    "wheel": "the wheel of tables with a locked caster, and held-out prediction",
    "cabinet": "two real cabinets pulled by a real PR2: hinge, catch, held-out force",
    "recorder": "a recorder killed in mid-run",
    "mcap": "recordings read by two independent readers",
    "kernel": "steps a second of the compiled world model, against pymunk",
    "inference": "posterior and evidence of one wheel, ours against others given the same likelihood",
    "pose": "a wheel's place from pushes of random tables",
    "calibration": "ranks of the truth among posterior draws, over the prior",
    "concealed": "recordings with one thing concealed: is it noticed, named, and does the repair predict",
    "tags": "tags found in rendered pictures of six cameras, and the model of their noise, against the truth",
    "control": "the body controller: Jacobians, limits, tick, jitter, steering; object paths and grasps in Bullet",
    "cart": "robot and cart on a plan: how near they stay to it, ticks, costmaps, a laser that falls silent",
    "namo": "the planner among movable obstacles: time, unreachable goals, random rooms, against a kinodynamic RRT",
    "lattice": "the lattice planner: cubicles beside SBPL's figures, a cart through narrow doors, what a turn sweeps",
    "next-experiment": "pushes until it is known what was left out, chosen by information or at random",
    "foreign": "a push as five other laboratories would have recorded it: roles proposed, fitted like the native one",
    "played-again": "what is learned live, and from the recording of it played again: number for number",
    "two-robots": "two robots in one ROS domain, each in a namespace: both move a table out of the way and arrive",
    "view": "the viewer on ten minutes of five objects: first picture, pictures a second, console",
    "fuzz": "hostile files and messages by the thousand: each is read, or refused in one line",
    "kills": "nodes of the NAMO graph killed and frozen at every state: rest, mission, recording",
    "fence": "random and hostile missions beside places that are kept out of: how near robot and load come to them",
    "soak": "an hour of NAMO in random rooms: memory, handles, threads, deadlines, the recording",
    "mismatch": "the watch over a stream: half an hour of clean pushing without an alarm, and how late alarms are",
    "scale": "many recordings on a Dask cluster: two workers against one, a worker killed, a thousand queued",
}

WITH_SETS = ("concealed", "fuzz")
"""Benches whose cases come in sets."""
WITH_MOST = (*WITH_SETS, "kills", "fence")
"""Benches whose cases can be counted."""
WITH_MINUTES = (*WITH_MOST, "mismatch", "soak")
"""Benches that can end after a time."""
WITH_CARRY = ("concealed", "kills", "fence", "mismatch")
"""Benches of hours, whose cases can be done on one machine after another."""

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
    "cart-desks": "desks on walls, which a laser low over the floor does not see: with the tilting one, and without",
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
