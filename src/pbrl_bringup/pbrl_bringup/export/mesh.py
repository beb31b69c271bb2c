"""A learned body's outline as a mesh that URDF and SDF refer to: a prism of convex parts, above the feet."""

from __future__ import annotations

from pbrl_bringup.export.rigid import RigidBody
from pbrl_bringup.export.xml_text import vector, xml_name
from pbrl_model.geometry import check_polygon, convex_parts

FOOT = 0.01
"""Radius of what stands on the floor [m]; the prism begins twice as high."""


def mesh_text(body: RigidBody) -> str:
    """Return an OBJ file: each convex part an object, faces turned outwards."""
    lines, count = [f"# {xml_name(body.name)}"], 0
    for number, part in enumerate(convex_parts(body.footprint)):
        corners, n = check_polygon(part).tolist(), len(part)
        lines.append(f"o part_{number}")
        lines += [f"v {vector((*corner, z))}" for z in (2.0 * FOOT, body.height) for corner in corners]
        low, high = [count + k + 1 for k in range(n)], [count + n + k + 1 for k in range(n)]
        lines += [f"f {low[0]} {low[k + 1]} {low[k]}" for k in range(1, n - 1)]
        lines += [f"f {high[0]} {high[k]} {high[k + 1]}" for k in range(1, n - 1)]
        for k in range(n):
            after = (k + 1) % n
            lines.append(f"f {low[k]} {low[after]} {high[after]}")
            lines.append(f"f {low[k]} {high[after]} {high[k]}")
        count += 2 * n
    return "\n".join(lines) + "\n"
