"""What is changed: small files of every kind, those of the repository and those that urmpipe makes itself."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz.byte_mutators import LARGEST

ROOT = Path(__file__).resolve().parents[2]
DATASETS = ROOT / "datasets/urmpipe_datasets"
SPECIMENS = ROOT / "tests/specimens"
SHARED = ROOT.parent / "shared"

SMALL = 60_000
"""Bytes of a specimen: thousands of them are read in a minute."""


@dataclass(frozen=True)
class Specimen:
    """A file that is read without an error, or with a known one.

    Attributes:
        name: How it is called; readers look at the end of it.
        data: What stands in it.
    """

    name: str
    data: bytes


LOG = SPECIMENS / "ur_rtde_spaces.csv"

TARGETS = {
    "xyz.csv": "x,y,z\n0.4,0.1,0.4\n0.5,0,0.4\n0.5,0.1,0.3\n",
    "timed.csv": "t;x;y;z;rx;ry;rz\n0;400;100;400;180;0;0\n0,5;410;100;400;180;0;0\n1;420;100;400;180;0;10\n",
    "quaternion.csv": "t,x,y,z,qx,qy,qz,qw\n0,0.4,0,0.4,1,0,0,0\n1,0.41,0,0.4,1,0,0,0\n2,0.4,0,0.4,0,1,0,0\n",
    "bare.txt": "0.4 0.1 0.4\n0.5 0 0.4\n",
    "units.csv": "X [mm],Y [mm],Z [mm],A [deg],B [deg],C [deg]\n400,100,400,0,90,0\n410,100,400,10,90,0\n",
}

PATHS = {
    "contour.csv": "x,y,z,r\n0.4,0,0.4,0\n0.5,0,0.4,0.02\n0.5,0.1,0.4,0\n0.4,0.1,0.4,0\n",
    "turning.csv": "x,y,z,r,rx,ry,rz\n0.4,0,0.4,0,3.1,0,0\n0.5,0,0.4,0.02,3.1,0,0\n0.5,0.1,0.4,0,3.1,0,0.5\n",
    "mm.csv": "x [mm];y [mm];z [mm];r [mm]\n400;0;400;0\n500;0;400;20\n500;100;400;0\n",
    "bare.txt": "0.4 0 0.4 0\n0.5 0 0.4 0.02\n0.5 0.1 0.4 0\n",
}

MAP = """robot = "ur5"
base = [0, 0, 0]
tool = [0, 0, 0.1, 0, 0, 0]
delimiter = " "

time = "timestamp"
joints = [JOINTS]
names = ["a", "b", "c", "d", "e", "f"]
signs = [-1, -1, -1, -1, -1, -1]
offsets = [0.1, 0.1, 0.1, 0.1, 0.1, 0.1]
position = ["actual_TCP_pose_0", "actual_TCP_pose_1", "actual_TCP_pose_2"]
orientation = ["actual_TCP_pose_3", "actual_TCP_pose_4", "actual_TCP_pose_5"]
rotation = "vector"

[unit]
timestamp = "s"
actual_q_0 = "rad"

[interval]
a = [-3.2, 3.2]
""".replace("JOINTS", ", ".join(f'"actual_q_{i}"' for i in range(6)))

DEFAULTS = """robot = "ur5e"
tool = [0, 0, 0.15]
base = "0,0,1"
tsp = "10ms"

[compare]
tolerance = {axis = 0.002, angle = "0.5deg"}
sync = "auto"
align = "start"
iso = false

[ingest]
unit = "deg"
joints = ["q1", "q2"]
strict = true
interval = "-180:180"

[ik]
every = true
restarts = 3
seed = 7

[plan]
velocity = 0.5
law = "jerk"
jerk = 20

[simulate]
set = ["log=log.csv", "reference=path.csv"]
duration = 1.0
"""

SYSTEM = """[system]
name = "two blocks"
step = "5ms"
duration = 0.1

[arguments]
robot = "urm6"
log = "log.csv"

[blocks.source]
unit = "log_source"
log = "$log"

[blocks.wrap]
unit = "repolarizer"
joints = 6

[blocks.foreign]
fmu = "foreign.fmu"
start = {n = 1}

[connections]
"wrap.raw" = "source.q"

[inputs]
"foreign.u" = { log = "log.csv", column = "actual_q_0" }

[loops]
iterate = false
tolerance = 1e-9
"""

URDF = """<?xml version="1.0"?>
<robot name="small">
  <link name="base"><visual><origin xyz="0 0 0.1" rpy="0 0 0"/><geometry><mesh filename="MESH" scale="1 1
1"/></geometry>
    <material name="red"><color rgba="1 0 0 1"/></material></visual></link>
  <link name="arm"><visual><geometry><cylinder radius="0.05" length="0.4"/></geometry></visual>
    <inertial><mass value="2"/><origin xyz="0 0 0.2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0"
izz="0.01"/></inertial></link>
  <link name="tip"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
  <joint name="j1" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.2" rpy="0 0
0"/><axis xyz="0 0 1"/>
    <limit lower="-3.14" upper="3.14" velocity="2" effort="10"/></joint>
  <joint name="j2" type="prismatic"><parent link="arm"/><child link="tip"/><origin xyz="0.1 0 0.4" rpy="0
1.57 0"/><axis xyz="1 0 0"/>
    <limit lower="-0.2" upper="0.2" velocity="1" effort="10"/><mimic joint="j1" multiplier="0.1"
offset="0"/></joint>
</robot>
"""

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="foreign" guid="{f0e1d2c3}" generationTool="none"
variableNamingConvention="structured">
<CoSimulation modelIdentifier="foreign" canHandleVariableCommunicationStepSize="true"
canGetAndSetFMUstate="true"/>
<UnitDefinitions><Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit><Unit name="deg"><BaseUnit rad="1"
factor="0.0174"/></Unit></UnitDefinitions>
<TypeDefinitions><SimpleType name="mode"><Enumeration><Item name="on" value="1"/><Item name="off"
value="2"/></Enumeration></SimpleType>
<SimpleType name="way"><Real quantity="Length" unit="mm" min="-10" max="10" nominal="1"/></SimpleType>
</TypeDefinitions>
<LogCategories><Category name="logAll"/></LogCategories>
<DefaultExperiment startTime="0" stopTime="1" tolerance="1e-6" stepSize="0.01"/>
<ModelVariables>
<ScalarVariable name="u" valueReference="1" causality="input" variability="continuous"><Real
declaredType="way" start="0"/></ScalarVariable>
<ScalarVariable name="phi[1]" valueReference="2" causality="output" variability="continuous"><Real
unit="deg"/></ScalarVariable>
<ScalarVariable name="phi[2]" valueReference="3" causality="output" variability="continuous"><Real
unit="deg"/></ScalarVariable>
<ScalarVariable name="n" valueReference="4" causality="parameter" variability="fixed"><Integer start="3"
min="0" max="9"/></ScalarVariable>
<ScalarVariable name="m" valueReference="5" causality="local" variability="discrete"><Enumeration
declaredType="mode"/></ScalarVariable>
<ScalarVariable name="b" valueReference="6" causality="output" variability="discrete"><Boolean/>
</ScalarVariable>
<ScalarVariable name="s" valueReference="7" causality="parameter" variability="fixed"><String start="x"/>
</ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="2" dependencies="1" dependenciesKind="dependent"/><Unknown
index="3"/><Unknown index="6" dependencies=""/></Outputs>
<InitialUnknowns><Unknown index="2" dependencies="1"/><Unknown index="3" dependencies=""/><Unknown
index="6"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>
"""

GLTF = {
    "asset": {"version": "2.0"},
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0, "children": []}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "buffers": [
        {
            "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA",
            "byteLength": 36,
        }
    ],
    "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 36}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    "images": [{"uri": "data:image/png;base64,AA=="}],
}

DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>
<unit name="meter" meter="1"/>
<up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh><source id="p"><float_array
id="a" count="9">0 0 0 1 0 0 0 1 0</float_array>
<technique_common><accessor source="#a" count="3" stride="3"><param name="X" type="float"/></accessor>
</technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="1"><input
semantic="VERTEX" source="#v" offset="0"/>
<p>0 1 2</p></triangles></mesh></geometry></library_geometries></COLLADA>
"""


def texts(files: dict[str, str]) -> list[Specimen]:
    """Return specimens of texts by their names."""
    return [Specimen(name, text.encode()) for name, text in files.items()]


def files(folder: Path, *patterns: str, largest: int = SMALL) -> Iterator[Specimen]:
    """Yield the small files of a folder, in the order of their names."""
    for path in sorted(one for pattern in patterns for one in folder.glob(pattern)):
        if path.is_file() and path.stat().st_size <= largest:
            yield Specimen(path.name, path.read_bytes())


def logs() -> list[Specimen]:
    """Return logs as text."""
    kinds = ("*.csv", "*.txt", "*.xyz", "wrong/*.csv")
    shared = files(SHARED / "logs", "*/*.csv", "*/*.txt", "*/*.dat", "*/*.log", "*/*.mod")
    head = (DATASETS / "logs/path.csv").read_bytes()[:4000]
    return [*files(SPECIMENS, *kinds), Specimen("path.csv", head.rpartition(b"\n")[0] + b"\n"), *shared]


def robots() -> list[Specimen]:
    """Return robots as TOML."""
    return list(files(DATASETS / "robots", "*.toml"))


def networks() -> list[Specimen]:
    """Return networks."""
    return list(files(DATASETS / "networks", "*.toml"))


def systems() -> list[Specimen]:
    """Return systems."""
    return [
        Specimen("two-blocks.toml", SYSTEM.encode()),
        *files(ROOT / "fmus/urmpipe_fmus/systems", "*.toml"),
    ]


def urdfs(made: Path) -> list[Specimen]:
    """Return robots as URDF."""
    return [
        Specimen("small.urdf", URDF.encode()),
        *files(made, "*.urdf"),
        *files(SHARED / "robots", "*/*.urdf"),
    ]


def tables(made: Path) -> list[Specimen]:
    """Return logs that are no text."""
    return list(files(made, "*.parquet", "*.feather", "*.mat", "*.np?"))


def maps(made: Path) -> list[Specimen]:
    """Return maps of logs."""
    return [Specimen("lab.toml", MAP.encode()), *files(made, "*.toml")]


def recordings(made: Path) -> list[Specimen]:
    """Return recordings of every kind of result that is made quickly."""
    return list(files(made, "*.rrd", largest=LARGEST))


def metadata(made: Path) -> list[Specimen]:
    """Return the metadata of recordings, each behind the name of its file."""
    return list(files(made, "*.json", largest=LARGEST))


def meshes() -> list[Specimen]:
    """Return meshes of every form."""
    triangle = struct.pack("<12fH", *([0.0] * 12), 0)
    document = json.dumps(GLTF).encode()
    document += b" " * (-len(document) % 4)
    chunk = struct.pack("<I4s", len(document), b"JSON") + document
    return [
        Specimen("m.gltf", json.dumps(GLTF).encode()),
        Specimen("m.glb", struct.pack("<4sII", b"glTF", 2, 12 + len(chunk)) + chunk),
        Specimen("m.stl", b"\0" * 80 + struct.pack("<I", 2) + triangle * 2),
        Specimen("m.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        Specimen("m.dae", DAE.encode()),
    ]


def fmus() -> list[Specimen]:
    """Return FMUs of another tool, for another platform and for this.

    Their library is none: nothing of them can run, whatever is changed.
    """
    from tests.fuzz.archive_mutators import packed

    from urmpipe_fmus.fmu_file import host_binaries

    def made(library: str) -> bytes:
        return packed(
            [
                ("modelDescription.xml", DESCRIPTION.encode()),
                (library, b"no library"),
                ("documentation/index.html", b"<p>"),
            ]
        )

    return [
        Specimen("away.fmu", made("binaries/other64/foreign.so")),
        Specimen("here.fmu", made(host_binaries("foreign")[0])),
    ]
