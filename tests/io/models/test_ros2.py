"""The ROS 2 package, without ROS: names, well-formed files, and a launch file that starts what it should."""

from __future__ import annotations

import py_compile
import re
import sys
import types
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from configured import configured
from hypothesis import given
from hypothesis import strategies as st

from dlogen.evaluation.shapes import hose_centre_line
from dlogen.io.models.ros2 import files, package_name, write
from dlogen.io.registry import model_format

#: The mandatory rules of REP 144.
REP_144 = re.compile(r"[a-z](_?[a-z0-9])+")

SETTINGS = {
    "default": {},
    "straight zero, twist": {"zero": "straight", "dof": 3},
    "floating": {"base": "floating"},
}


@pytest.fixture(scope="module")
def make_package(fitted, make_result):
    def made(joints: dict, stem: str = "My hose-1.v2"):
        result = make_result(fitted(hose_centre_line()), 0.02, 0.01)
        result = configured(result, joints=joints)
        return result, write(result, stem)

    return made


@pytest.fixture(scope="module", params=SETTINGS)
def package(request, make_package, tmp_path_factory):
    """Result and folder of the package."""
    result, contents = make_package(SETTINGS[request.param])
    folder = tmp_path_factory.mktemp("ws") / "src"
    for name, content in contents.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    (root,) = folder.iterdir()
    return result, root


def test_the_files_are_those_that_are_announced(make_package) -> None:
    _, contents = make_package({})
    assert tuple(contents) == files("My hose-1.v2") == model_format("ros2").files("My hose-1.v2")
    assert {name.split("/")[0] for name in contents} == {"my_hose_1_v2_description"}


@pytest.mark.parametrize(
    ("stem", "name"),
    [
        ("cloud", "cloud"),
        ("Scan 07", "scan_07"),
        ("2nd-scan", "dlo_2nd_scan"),
        ("größe", "grosse"),
        ("scan – 07", "scan_07"),
        ("線", "dlo_d36cefb1"),
        ("hose 線", "hose_d55bfbfb"),
        ("__x__y__", "x_y"),
        ("hose_description", "hose"),
        ("_description", "description"),
        ("", "dlo"),
    ],
)
def test_package_names(stem: str, name: str) -> None:
    assert package_name(stem) == f"{name}_description"


def test_names_whose_letters_are_lost_stay_apart() -> None:
    stems = ["кабель", "шланг", "电缆", "軟管", "κάλως", "🐍", "🐢", "hose 1 線", "hose 1 管", "cable_\udcff", "cable"]
    assert len({package_name(stem) for stem in stems}) == len(stems)
    assert all(REP_144.fullmatch(package_name(stem)) for stem in stems)
    assert package_name("が") == package_name("か\u3099")


@given(st.text(max_size=30))
def test_any_stem_gives_a_valid_name(stem: str) -> None:
    assert REP_144.fullmatch(package_name(stem))
    assert len(set(files(stem))) == len(files(stem))
    assert all(re.fullmatch(r"[\w./]+", name, re.ASCII) for name in files(stem))


def test_package_xml(package) -> None:
    _, root = package
    xml = ElementTree.parse(root / "package.xml").getroot()
    assert xml.tag == "package" and xml.get("format") == "3"
    assert xml.findtext("name") == root.name
    assert re.fullmatch(r"\d+\.\d+\.\d+", xml.findtext("version"))
    assert xml.findtext("description").strip()
    assert xml.findtext("license")
    assert "@" in xml.find("maintainer").get("email")
    assert xml.findtext("maintainer")
    assert xml.findtext("buildtool_depend") == "ament_cmake"
    assert xml.findtext("export/build_type") == "ament_cmake"


def test_cmake_installs_every_folder(package) -> None:
    _, root = package
    cmake = (root / "CMakeLists.txt").read_text()
    assert f"project({root.name} " in cmake
    installed = re.search(r"install\(DIRECTORY ([\w ]+) DESTINATION share/\$\{PROJECT_NAME\}\)", cmake)[1].split()
    assert sorted(installed) == sorted(path.name for path in root.iterdir() if path.is_dir())
    assert cmake.rstrip().endswith("ament_package()")


class Recorded:
    """Stands for any class of ROS: keeps what it was made with."""

    def __init__(self, *args, **kwargs) -> None:
        self.args, self.kwargs = args, kwargs


def launched(root, monkeypatch) -> dict[str, Recorded]:
    """The nodes of the launch file, by package, without ROS."""
    makes = {
        "launch": ["LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument"],
        "launch.conditions": ["IfCondition", "UnlessCondition"],
        "launch.substitutions": ["LaunchConfiguration"],
        "launch_ros": [],
        "launch_ros.actions": ["Node"],
        "launch_ros.parameter_descriptions": ["ParameterValue"],
        "ament_index_python": [],
        "ament_index_python.packages": [],
    }
    for name, classes in makes.items():
        module = types.ModuleType(name)
        for item in classes:
            setattr(module, item, type(item, (Recorded,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    share = {root.name: str(root)}
    sys.modules["ament_index_python.packages"].get_package_share_directory = share.__getitem__
    scope: dict = {}
    path = root / "launch" / "display.launch.py"
    exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), scope)
    (items,) = scope["generate_launch_description"]().args
    return {item.kwargs["package"]: item for item in items if type(item).__name__ == "Node"}


def test_launch_file(package, monkeypatch) -> None:
    result, root = package
    py_compile.compile(str(root / "launch" / "display.launch.py"), cfile=str(root.parent / "x.pyc"), doraise=True)
    nodes = launched(root, monkeypatch)
    floating = result.settings["joints"]["base"] == "floating"
    assert set(nodes) == {
        "robot_state_publisher",
        "joint_state_publisher",
        "joint_state_publisher_gui",
        "rviz2",
        *(["tf2_ros"] if floating else []),
    }
    # All that it starts, and the library that it is written with, is declared.
    depends = {item.text for item in ElementTree.parse(root / "package.xml").findall("exec_depend")}
    assert depends == {*nodes, "launch", "launch_ros", "ament_index_python"}
    (parameters,) = nodes["robot_state_publisher"].kwargs["parameters"]
    assert parameters["robot_description"].args[0].startswith("<?xml")
    assert parameters["robot_description"].kwargs == {"value_type": str}
    for name in ("joint_state_publisher", "joint_state_publisher_gui"):
        (pose,) = nodes[name].kwargs["parameters"]
        assert yaml.safe_load(Path(pose).read_text(encoding="utf-8"))
    assert yaml.safe_load(Path(nodes["rviz2"].kwargs["arguments"][1]).read_text(encoding="utf-8"))
    if floating:
        arguments = nodes["tf2_ros"].kwargs["arguments"]
        given = dict(zip(arguments[::2], arguments[1::2], strict=True))
        assert all(isinstance(value, str) for value in arguments)
        assert [float(given[f"--{axis}"]) for axis in "xyz"] == result.chain.joints[0].tolist()
        w, x, y, z = (float(given[f"--q{axis}"]) for axis in "wxyz")
        along = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]
        assert along == pytest.approx(result.chain.transforms[0, :3, 0], abs=1e-12)
        assert (given["--frame-id"], given["--child-frame-id"]) == ("base_link", "segment_01")


def test_the_urdf_is_the_one_of_the_urdf_format(package) -> None:
    result, root = package
    (path,) = (root / "urdf").iterdir()
    (expected,) = model_format("urdf").write(result, "My hose-1.v2").values()
    assert path.read_bytes() == expected
    # Nothing in it refers to a file that is not there.
    assert "filename=" not in path.read_text(encoding="utf-8")


@pytest.mark.oracle
def test_the_scanned_pose(package) -> None:
    yourdfpy = pytest.importorskip("yourdfpy")
    result, root = package
    (path,) = (root / "urdf").iterdir()
    robot = yourdfpy.URDF.load(path, build_scene_graph=True)
    pose = yaml.safe_load((root / "config" / "scanned_pose.yaml").read_text())["/**"]["ros__parameters"]["zeros"]
    assert list(pose) == [name for name in robot.actuated_joint_names if name != "base_joint"]
    assert all(isinstance(value, float) for value in pose.values())  # ROS is strict about types
    if result.settings["joints"]["base"] == "floating":
        return  # yourdfpy has its own values for floating joints
    robot.update_cfg(pose)
    names = [f"segment_{i + 1:02d}" for i in range(len(result.chain.lengths))]
    found = np.array([robot.get_transform(name)[:3, 3] for name in [*names, "tip"]])
    assert found == pytest.approx(result.chain.joints, abs=1e-9)
    # It is not all zero when the zero pose is another one.
    straight = result.settings["joints"]["zero"] == "straight"
    assert (max(map(abs, pose.values())) > 0.1) == straight


def test_one_segment_has_no_joint_values(straight, make_result) -> None:
    contents = write(make_result(straight([0, 0, 0], [1, 0, 0])), "x")
    pose = yaml.safe_load(contents["x_description/config/scanned_pose.yaml"])
    assert "zeros" not in pose["/**"]["ros__parameters"]


def test_rviz_looks_at_the_model(package) -> None:
    result, root = package
    rviz = yaml.safe_load((root / "rviz" / "display.rviz").read_text())["Visualization Manager"]
    classes = [display["Class"] for display in rviz["Displays"]]
    assert "rviz_default_plugins/RobotModel" in classes
    urdf = ElementTree.parse(next((root / "urdf").iterdir()))
    assert rviz["Global Options"]["Fixed Frame"] == urdf.find("link").get("name")
    view = rviz["Views"]["Current"]
    focus = np.array([view["Focal Point"][axis] for axis in "XYZ"], dtype=float)
    low, high = result.chain.joints.min(axis=0), result.chain.joints.max(axis=0)
    assert (focus >= low - 1e-3).all() and (focus <= high + 1e-3).all()
    assert view["Distance"] > np.linalg.norm(high - low)
