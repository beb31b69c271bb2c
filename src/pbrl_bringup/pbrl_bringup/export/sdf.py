"""A learned object as SDF 1.9: a prism on its feet, each point of the floor with its own friction."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

from pbrl_bringup.export.mesh import FOOT
from pbrl_bringup.export.rigid import RigidBody
from pbrl_bringup.export.xml_text import add, comment, number, text_of, vector, xml_name


def sdf_text(body: RigidBody, mesh: str) -> str:
    """Return the file; the link's origin is the body's, on the floor.

    Args:
        body: learned.
        mesh: name of the file with `mesh_text`.
    """
    root = Element("sdf", version="1.9")
    comment(root, body.told)
    model = add(root, "model", name=xml_name(body.name))
    link = add(model, "link", name=xml_name(body.name))
    inertial = add(link, "inertial")
    add(inertial, "pose", vector((*body.com, 0.0, 0.0, 0.0)))
    add(inertial, "mass", body.mass)
    inertia = add(inertial, "inertia")
    values = (body.inertia[0], body.product, 0.0, body.inertia[1], 0.0, body.inertia[2])
    for tag, value in zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), values, strict=True):
        add(inertia, tag, value)
    for kind in ("collision", "visual"):
        part = add(link, kind, name=f"outline_{kind}")
        add(add(add(part, "geometry"), "mesh"), "uri", mesh)
    for k, (x, y) in enumerate(body.feet.tolist()):
        _contact(link, f"foot_{k}", x, y, body.foot_mu, body.foot_mu, 0.0)
    for wheel in body.wheels:
        share = float(body.contacts)
        _contact(link, wheel.name, *wheel.place, share * wheel.mu_x, share * wheel.mu_y, wheel.theta)
    return text_of(root)


def _contact(link: Element, name: str, x: float, y: float, along: float, across: float, theta: float) -> None:
    part = add(link, "collision", name=name)
    add(part, "pose", vector((x, y, FOOT, 0.0, 0.0, 0.0)))
    add(add(add(part, "geometry"), "sphere"), "radius", FOOT)
    ode = add(add(add(part, "surface"), "friction"), "ode")
    add(ode, "mu", number(along))
    add(ode, "mu2", number(across))
    add(ode, "fdir1", vector((math.cos(theta), math.sin(theta), 0.0)))
