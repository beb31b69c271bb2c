"""A learned object as URDF: a prism on its feet; friction as pybullet (`contact`) and Gazebo (`gazebo`) read it."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

from pbrl_bringup.export.mesh import FOOT
from pbrl_bringup.export.rigid import RigidBody
from pbrl_bringup.export.xml_text import add, comment, number, text_of, vector, xml_name

TRIFLE, OF_TRIFLE = 1e-6, 1e-9
"""Mass [kg] and inertia [kg m^2] of a foot: a link without any would be given a kilogram by some readers."""


def urdf_text(body: RigidBody, mesh: str) -> str:
    """Return the file; the first link's origin is the body's, on the floor.

    Args:
        body: learned.
        mesh: name of the file with `mesh_text`.
    """
    name = xml_name(body.name)
    root = Element("robot", name=name)
    comment(root, body.told)
    link = add(root, "link", name=name)
    inertial = add(link, "inertial")
    add(inertial, "origin", xyz=vector(body.com), rpy="0 0 0")
    add(inertial, "mass", value=body.mass)
    xx, yy, zz = body.inertia
    add(inertial, "inertia", ixx=xx, ixy=body.product, ixz=0.0, iyy=yy, iyz=0.0, izz=zz)
    for kind in ("visual", "collision"):
        part = add(link, kind)
        add(part, "origin", xyz="0 0 0", rpy="0 0 0")
        add(add(part, "geometry"), "mesh", filename=mesh)
    for k, (x, y) in enumerate(body.feet.tolist()):
        _foot(root, name, f"{name}_foot_{k}", x, y, body.foot_mu, body.foot_mu, 0.0)
    for wheel in body.wheels:
        share = float(body.contacts)
        of = f"{name}_{wheel.name}"
        _foot(root, name, of, *wheel.place, share * wheel.mu_x, share * wheel.mu_y, wheel.theta)
    return text_of(root)


def _foot(root: Element, parent: str, name: str, x: float, y: float, along: float, across: float, theta: float) -> None:
    link = add(root, "link", name=name)
    contact = add(link, "contact")
    # One number is all that this reader has: the larger one holds.
    add(contact, "lateral_friction", value=max(along, across))
    inertial = add(link, "inertial")
    add(inertial, "mass", value=TRIFLE)
    add(inertial, "inertia", ixx=OF_TRIFLE, ixy=0.0, ixz=0.0, iyy=OF_TRIFLE, iyz=0.0, izz=OF_TRIFLE)
    add(add(add(link, "collision"), "geometry"), "sphere", radius=FOOT)
    joint = add(root, "joint", name=f"{name}_joint", type="fixed")
    add(joint, "origin", xyz=vector((x, y, FOOT)), rpy="0 0 0")
    add(joint, "parent", link=parent)
    add(joint, "child", link=name)
    gazebo = add(root, "gazebo", reference=name)
    add(gazebo, "mu1", number(along))
    add(gazebo, "mu2", number(across))
    add(gazebo, "fdir1", vector((math.cos(theta), math.sin(theta), 0.0)))
