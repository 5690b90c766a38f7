"""URDF out: a chain as links and joints, with its masses and its shapes, or placeholder solids.

Links `world`, `base_link`, `link1`, ..., `tip`, `tool0`; between them the joints `urmpipe_base`, those of the
chain, `urmpipe_tip` and `urmpipe_tool`. Numbers are written with all digits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

from urmpipe_models.arm.chain import (
    Box,
    Capsule,
    Chain,
    Cylinder,
    Inertial,
    Joint,
    Mesh,
    Shape,
    Sphere,
    Visual,
)
from urmpipe_models.arm.solids import build_placeholder_solids
from urmpipe_models.errors import RobotError, escape_xml
from urmpipe_models.files import EXPORT_MARK, write_text_atomic
from urmpipe_models.math3d import matrix_to_rpy, translation
from urmpipe_models.robots.urdf import MOMENTS
from urmpipe_models.robots.urdf_tree import (
    BASE_JOINT,
    MASS_JOINT,
    PLACEHOLDER_MATERIAL,
    TIP_JOINT,
    TOOL_JOINT,
    UNLIMITED,
)


def write_urdf(chain: Chain, path: str | Path) -> None:
    """Write a chain as a URDF file; see `urdf_text`.

    Raises:
        OutputError: If the file cannot be written.
        RobotError: If a joint has the name of a joint for base, tip, tool or a mass.
    """
    write_text_atomic(Path(path), urdf_text(chain))


def urdf_text(chain: Chain) -> str:
    """Return a chain as URDF. Read back with `read_urdf` it is the same chain, to rounding.

    Links: `world`, `base_link`, then `link1`, `link2`, ... carried by the chain's joints, the fixed ones
    too, then `tip` and `tool0`. The fixed joints `urmpipe_base`, `urmpipe_tip` and `urmpipe_tool` are the
    chain's base, tip and tool. Point p_k is where joint k + 1 is on link k, so the origin of link k + 1
    if that joint is not prismatic; the last one is the origin of tool0. A revolute joint without limits is
    `continuous`; elsewhere the largest double represents infinity. Limits of acceleration make it URDF 1.2,
    which has them. An arm without visuals gets those of `build_placeholder_solids`, which `read_urdf` leaves
    out again; as URDF has no capsules, each is a cylinder and two spheres. A link has one mass; further ones
    of a joint are separate links, fixed to it by joints whose names begin with `urmpipe_mass_`. URDF has no
    gravity, no drives and no sources of masses.

    Raises:
        RobotError: If a joint has one of these names.
    """
    names = [joint.name for joint in chain.joints]
    reserved = [
        name for name in names if name in {BASE_JOINT, TIP_JOINT, TOOL_JOINT} or name.startswith(MASS_JOINT)
    ]
    if reserved:
        listed = ", ".join(reserved)
        raise RobotError(f"robot {chain.name}: joint name {listed} stands for base, tip, tool or a mass")
    joints = [
        Joint(BASE_JOINT, "fixed", chain.base),
        *chain.joints,
        Joint(TIP_JOINT, "fixed", chain.tip),
        Joint(TOOL_JOINT, "fixed", chain.tool),
    ]
    links = ["world", "base_link", *(f"link{k}" for k in range(1, len(chain.joints) + 1)), "tip", "tool0"]
    carriers = dict(zip(links[1:-2], [None, *names], strict=True))
    visuals, material = chain.visuals, None
    if not visuals:
        visuals, material = tuple(_without_capsules(chain)), PLACEHOLDER_MATERIAL
    lines = [
        '<?xml version="1.0" encoding="utf-8"?>',
        f"<!-- {EXPORT_MARK}: lengths in m, angles in rad -->",
        f"<robot name={_quote(chain.name)}{_version(chain)}>",
        f'  <material name="{PLACEHOLDER_MATERIAL}"><color rgba="0.35 0.55 0.75 1.0"/></material>',
        '  <link name="world"/>',
    ]
    for joint, parent, child in zip(joints, links[:-1], links[1:], strict=True):
        carried: list[str] = []
        masses: list[Inertial] = []
        if child in carriers:
            for visual in visuals:
                carried += _visual_lines(visual, material) if visual.joint == carriers[child] else []
            masses = [inertial for inertial in chain.inertials if inertial.joint == carriers[child]]
        lines += _link_lines(child, [*carried, *_inertial_lines(masses[:1])])
        lines += _joint_lines(joint, parent, child)
        for k, mass in enumerate(masses[1:], start=2):
            lines += _link_lines(f"{child}_mass{k}", _inertial_lines([mass]))
            lines += _joint_lines(Joint(f"{MASS_JOINT}{child}_{k}", "fixed"), child, f"{child}_mass{k}")
    return "\n".join([*lines, "</robot>"]) + "\n"


def _version(chain: Chain) -> str:
    """Return the version attribute that limits of acceleration require, empty for an arm without them.

    Parsers before urdfdom 6 reject the attribute, later ones ignore accelerations without it.
    """
    limited = any(joint.kind != "fixed" and math.isfinite(joint.acceleration) for joint in chain.joints)
    return ' version="1.2"' if limited else ""


def _link_lines(name: str, inside: Sequence[str]) -> list[str]:
    return [f'  <link name="{name}">', *inside, "  </link>"] if inside else [f'  <link name="{name}"/>']


def _inertial_lines(inertials: Sequence[Inertial]) -> list[str]:
    """Return the lines of at most one inertial."""
    return [
        line
        for inertial in inertials
        for line in (
            "    <inertial>",
            f'      <origin xyz="{_numbers(inertial.centre)}"/>',
            f'      <mass value="{float(inertial.mass)!r}"/>',
            f"      <inertia {_attributes(dict(zip(MOMENTS, inertial.inertia, strict=True)))}/>",
            "    </inertial>",
        )
    ]


def _attributes(values: Mapping[str, float]) -> str:
    return " ".join(f'{key}="{float(value)!r}"' for key, value in values.items())


def _without_capsules(chain: Chain) -> Iterator[Visual]:
    """Yield the placeholder solids of an arm; a capsule as a cylinder and a sphere at each end."""
    for solid in build_placeholder_solids(chain):
        if not isinstance(solid.shape, Capsule):
            yield solid
            continue
        radius, length = solid.shape.radius, solid.shape.length
        yield replace(solid, shape=Cylinder(radius, length))
        for z in (-length / 2.0, length / 2.0):
            yield replace(solid, shape=Sphere(radius), origin=solid.origin @ translation(0.0, 0.0, z))


def _visual_lines(visual: Visual, material: str | None) -> list[str]:
    """Return a visual with the material of this name, else with the visual's colour."""
    xyz, rpy = _numbers(visual.origin.translation), _numbers(matrix_to_rpy(visual.origin.rotation))
    lines = [
        "    <visual>",
        f'      <origin xyz="{xyz}" rpy="{rpy}"/>',
        f"      <geometry>{_shape(visual.shape)}</geometry>",
    ]
    if material is not None:
        lines.append(f'      <material name="{material}"/>')
    elif visual.colour is not None:
        rgba = _numbers(visual.colour)
        lines.append(f'      <material name="{rgba}"><color rgba="{rgba}"/></material>')
    return [*lines, "    </visual>"]


def _shape(shape: Shape) -> str:
    if isinstance(shape, Mesh):
        return f'<mesh filename={_quote(shape.file)} scale="{_numbers(shape.scale)}"/>'
    if isinstance(shape, Box):
        return f'<box size="{_numbers(shape.size)}"/>'
    if isinstance(shape, Sphere):
        return f'<sphere radius="{float(shape.radius)!r}"/>'
    tag = type(shape).__name__.lower()
    return f'<{tag} radius="{float(shape.radius)!r}" length="{float(shape.length)!r}"/>'


def _joint_lines(joint: Joint, parent: str, child: str) -> list[str]:
    unlimited = joint.lower == -math.inf and joint.upper == math.inf
    type_ = "continuous" if joint.kind == "revolute" and unlimited else joint.kind
    xyz, rpy = _numbers(joint.origin.translation), _numbers(matrix_to_rpy(joint.origin.rotation))
    lines = [
        f'  <joint name={_quote(joint.name)} type="{type_}">',
        f'    <parent link="{parent}"/>',
        f'    <child link="{child}"/>',
        f'    <origin xyz="{xyz}" rpy="{rpy}"/>',
    ]
    if joint.kind != "fixed":
        keys = ["lower", "upper", "effort", "velocity"]
        keys += ["acceleration"] if math.isfinite(joint.acceleration) else []
        limits = {key: max(-UNLIMITED, min(UNLIMITED, float(getattr(joint, key)))) for key in keys}
        lines += [f'    <axis xyz="{_numbers(joint.axis)}"/>', f"    <limit {_attributes(limits)}/>"]
    if joint.mimic is not None:
        leader, multiplier, offset = joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset
        values = f'multiplier="{float(multiplier)!r}" offset="{float(offset)!r}"'
        lines.append(f"    <mimic joint={_quote(leader)} {values}/>")
    return [*lines, "  </joint>"]


def _quote(text: str) -> str:
    """Return a text as the value of an attribute, with invisible characters as numbers."""
    return escape_xml(quoteattr(text))


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
