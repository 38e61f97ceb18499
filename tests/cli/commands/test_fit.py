"""`dlogen fit` from the outside: files, exit codes, messages."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from dlogen.cli.main import cli
from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.cloud_files import write_cloud

LINE = centre_line("bent")


@pytest.fixture(scope="module")
def cloud(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("clouds") / "cloud.ply"
    write_cloud(path, sample_tube(LINE, 0.02, 3000, np.random.default_rng(11)).points)
    return path


def run(*arguments: object, stdin: bytes | None = None) -> Result:
    return CliRunner().invoke(cli, ["fit", *map(str, arguments)], input=stdin)


def test_writes_three_files_and_nothing_else(cloud: Path, tmp_path: Path) -> None:
    result = run(cloud, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    assert result.stdout == ""
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "cloud.json",
        "cloud.report.json",
        "cloud.urdf",
    ]
    chain = json.loads((tmp_path / "out" / "cloud.json").read_text())
    assert chain["schema"] == "dlogen.chain/1"
    assert chain["segment_count"] == len(chain["links"]) == len(chain["joints"]) - 1
    assert chain["max_deviation"] <= chain["e_max"]
    assert chain["length"] == pytest.approx(LINE.length, rel=0.02)


@pytest.mark.parametrize("profile", ["paper", "refined"])
def test_the_same_input_gives_the_same_bytes(cloud: Path, tmp_path: Path, profile: str) -> None:
    for folder in ("a", "b"):
        arguments = ["--profile", profile, "--set", "report.timings=false", "--format", "all"]
        assert run(cloud, "-o", tmp_path / folder, *arguments).exit_code == 0
    made = [path for path in (tmp_path / "a").rglob("*") if path.is_file()]
    assert len(made) > 10
    for path in made:
        assert path.read_bytes() == (tmp_path / "b" / path.relative_to(tmp_path / "a")).read_bytes(), path.name


def test_json_on_stdout_is_the_report(cloud: Path, tmp_path: Path) -> None:
    result = run(cloud, "-o", tmp_path, "--json", "-q")
    assert result.exit_code == 0
    assert result.stderr == ""
    assert result.stdout == (tmp_path / "cloud.report.json").read_text()
    report = json.loads(result.stdout)
    assert report["schema"] == "dlogen.report/1"
    assert set(report["mdtw"]) >= {"mean", "std", "max", "path_length", "error", "s"}
    assert len(report["mdtw"]["error"]) == len(report["mdtw"]["s"]) == report["mdtw"]["path_length"]
    assert set(report["residual"]) >= {"rms", "median", "radius"}
    assert all(seconds >= 0.0 for seconds in report["timings"].values())


def test_existing_outputs_are_refused_without_force(cloud: Path, tmp_path: Path) -> None:
    (tmp_path / "cloud.urdf").write_text("mine")
    refused = run(cloud, "-o", tmp_path)
    assert refused.exit_code == 2
    assert "--force" in refused.stderr
    assert (tmp_path / "cloud.urdf").read_text() == "mine"
    assert not (tmp_path / "cloud.json").exists()
    assert run(cloud, "-o", tmp_path, "--force").exit_code == 0
    assert (tmp_path / "cloud.urdf").read_text() != "mine"


def test_stdin_and_millimetres(cloud: Path, tmp_path: Path) -> None:
    from dlogen.io.cloud_files import read_cloud

    in_mm = tmp_path / "mm.ply"
    write_cloud(in_mm, read_cloud(cloud).points * 1e3)
    assert run("-", "-o", tmp_path, "--set", "units=mm", stdin=in_mm.read_bytes()).exit_code == 0
    assert run(cloud, "-o", tmp_path / "m").exit_code == 0
    from_mm, from_m = (
        np.array(json.loads((folder / "cloud.json").read_text())["skeleton"]["points"])
        for folder in (tmp_path, tmp_path / "m")
    )
    assert from_mm == pytest.approx(from_m, abs=1e-5)


def test_reference_measures_against_a_known_line(cloud: Path, tmp_path: Path) -> None:
    np.savetxt(tmp_path / "line.csv", LINE.points(2000), delimiter=",")
    result = run(cloud, "-o", tmp_path, "--json", "-q", "--profile", "paper", "--reference", tmp_path / "line.csv")
    assert result.exit_code == 0, result.stderr
    reference = json.loads(result.stdout)["reference"]
    # The paper's Table II has 2.42 mm.
    assert 0.0 < reference["mean"] < 1.25 * 2.42e-3


def test_the_comparison_with_a_reference_is_a_line_on_stderr(cloud: Path, tmp_path: Path) -> None:
    np.savetxt(tmp_path / "line.csv", LINE.points(2000), delimiter=",")
    result = run(cloud, "-o", tmp_path, "--reference", tmp_path / "line.csv")
    line = next(line for line in result.stderr.splitlines() if line.startswith("against"))
    reference = json.loads((tmp_path / "cloud.report.json").read_text())["reference"]
    assert f"mean {1e3 * reference['mean']:.3f} mm" in line and f"max {1e3 * reference['max']:.3f} mm" in line


def test_a_reference_is_read_before_the_fit(cloud: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dlogen.pipeline.fit", lambda *_, **__: pytest.fail("fitted first"))
    (tmp_path / "line.csv").write_text("no curve")
    result = run(cloud, "-o", tmp_path, "--reference", tmp_path / "line.csv")
    assert result.exit_code == 2, result.stderr
    assert "line.csv" in result.stderr
    twice = run("-", "-o", tmp_path, "--reference", "-", stdin=cloud.read_bytes())
    assert twice.exit_code == 2
    assert "both" in twice.stderr and "hint:" in twice.stderr


def test_findings_of_a_kind_are_one_line(tmp_path: Path) -> None:
    tube = sample_tube(centre_line("straight"), 0.02, 2000, np.random.default_rng(3)).points
    others = [tube[tube[:, 1] < tube[:, 1].min() + 0.5] + [0.4 + 0.3 * i, 0.0, 0.2] for i in range(12)]
    write_cloud(tmp_path / "scene.ply", np.vstack([tube, *others]))
    result = run(tmp_path / "scene.ply", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    lines = [line for line in result.stderr.splitlines() if line.endswith("[several-objects]")]
    assert len(lines) == 1
    assert lines[0].startswith("warning: 12 times: another object is in the cloud")
    assert lines[0].count("(") == 9 and "and 4 more places" in lines[0]
    found = json.loads((tmp_path / "out" / "scene.report.json").read_text())["quality"]["findings"]
    assert [finding["code"] for finding in found].count("several-objects") == 12


@pytest.mark.parametrize(
    ("profile", "stages"),
    [("paper", ["normals", "projected", "sorted", "unreached"]), ("refined", ["ordering", "tube", "off_tube"])],
)
def test_dump_writes_the_stages_in_order(cloud: Path, tmp_path: Path, profile: str, stages: list[str]) -> None:
    arguments = ["-o", tmp_path / "out", "--dump", tmp_path / "stages", "--profile", profile]
    result = run(cloud, *arguments)
    assert result.exit_code == 0
    made = [*(f"{name}.ply" for name in stages), "skeleton.csv", "joints.csv", "chain.csv", "mdtw.csv"]
    expected = {f"cloud.{i + 1}_{name}" for i, name in enumerate(made)}
    assert {path.name for path in (tmp_path / "stages").iterdir()} == expected
    told = result.stderr.splitlines()[-1]
    assert str(tmp_path / "stages") in told and all(name in told for name in expected)


def test_flag_beats_set_beats_file(cloud: Path, tmp_path: Path) -> None:
    (tmp_path / "c.yaml").write_text("profile: refined\ne_max: 0.02\nr: 0.02\n")
    result = run(cloud, "-c", tmp_path / "c.yaml", "--set", "e_max=0.005", "--profile", "paper", "-o", tmp_path)
    assert result.exit_code == 0, result.stderr
    report = json.loads((tmp_path / "cloud.report.json").read_text())
    assert (report["profile"], report["e_max"]) == ("paper", 0.005)


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--set", "emax=0.01"], 2, "e_max"),
        (["--set", "e_max=-1"], 2, "e_max"),
        (["--set", "r=0.02", "--set", "r_n=0.03"], 2, "r_n"),
        (["--format", "urfd"], 2, "urdf"),
        (["-c", "nowhere.yaml"], 2, "nowhere.yaml"),
        (["--reference", "nowhere.csv"], 2, "nowhere.csv"),
        (["--profile", "best"], 2, "best"),
        (["--set", "profile=paper", "--set", "sorting.start=99999"], 2, "sorting.start"),
        (["--set", "profile=paper", "--set", "normals.orientation=stored"], 2, "stored"),
        (["--set", "e_max=1e-12"], 1, "e_max"),
    ],
)
def test_bad_calls_give_one_message_and_no_files(
    cloud: Path, tmp_path: Path, arguments: list[str], code: int, words: str
) -> None:
    result = run(cloud, "-o", tmp_path / "out", *arguments)
    assert result.exit_code == code, result.stderr
    assert words in result.stderr
    assert "Traceback" not in result.stderr and result.stdout == ""
    assert not (tmp_path / "out").exists()


def test_nothing_is_left_behind_when_the_folder_cannot_be_written(cloud: Path, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file, not a folder")
    result = run(cloud, "-o", tmp_path / "out")
    assert result.exit_code == 2
    assert "hint:" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def random_points(count: int, scale: np.ndarray) -> np.ndarray:
    return np.random.default_rng(1).normal(size=(count, 3)) * scale


def ball() -> np.ndarray:
    points = random_points(4000, np.ones(3))
    return 0.1 * points / np.linalg.norm(points, axis=1)[:, None]


def ring() -> np.ndarray:
    angle, around = np.random.default_rng(2).uniform(0, 2 * np.pi, (2, 5000))
    ring = 0.3 + 0.01 * np.cos(around)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), 0.01 * np.sin(around)], axis=1)


def two_objects() -> np.ndarray:
    tube = sample_tube(centre_line("straight"), 0.02, 2000, np.random.default_rng(3)).points
    return np.vstack([tube, tube + np.array([0.5, 0.3, 0.6])])


def branched() -> np.ndarray:
    line = sample_tube(centre_line("straight"), 0.02, 3000, np.random.default_rng(4)).points
    limb = line[line[:, 1] > -0.4] @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]])
    middle = centre_line("straight")(0.5)[0]
    return np.vstack([line, limb - limb.mean(axis=0) + middle + [0.25, 0.0, 0.0]])


#: Clouds from which no trustworthy chain can be made; each is refused or marked.
BAD = {
    "one place": np.zeros((500, 3)),
    "too few": random_points(5, np.ones(3)),
    "pixels": np.floor(random_points(2000, np.array([100, 100, 0]))),
    "flat": random_points(2000, np.array([1.0, 0.01, 0.0])),
    "plane": np.random.default_rng(0).uniform(-1, 1, (4000, 3)) * [0.5, 0.5, 1e-3],
    "ball": ball(),
    "ring": ring(),
    "several objects": two_objects(),
    "branch": branched(),
}


@pytest.mark.parametrize("kind", BAD)
@pytest.mark.parametrize("profile", ["paper", "refined"])
def test_bad_clouds_are_refused_or_marked(kind: str, profile: str, tmp_path: Path) -> None:
    write_cloud(tmp_path / "bad.ply", BAD[kind])
    result = run(tmp_path / "bad.ply", "-o", tmp_path / "out", "--profile", profile)
    assert "Traceback" not in result.stderr and "internal error" not in result.stderr
    if result.exit_code == 0:
        quality = json.loads((tmp_path / "out" / "bad.json").read_text())["quality"]
        assert quality["verdict"] in ("doubtful", "bad"), quality
        assert quality["findings"]
        assert run(tmp_path / "bad.ply", "-o", tmp_path / "out", "--force", "--strict").exit_code == 1
    else:
        # A file whose points all coincide has one point left: too few to read it as a cloud of anything.
        assert result.exit_code in (1, 2)
        assert "hint:" in result.stderr
        assert not (tmp_path / "out").exists()


def test_a_known_length(cloud: Path, tmp_path: Path) -> None:
    right = run(cloud, "-o", tmp_path, "--length", LINE.length)
    assert right.exit_code == 0 and "length-mismatch" not in right.stderr
    wrong = run(cloud, "-o", tmp_path, "--force", "--set", "length=1", "--length", 1.1 * LINE.length)
    assert wrong.exit_code == 0 and "shorter than the known length of 5.3" in wrong.stderr
    assert run(cloud, "-o", tmp_path, "--force", "--length", -1).exit_code == 2


def test_gaps_that_are_to_be_bridged(tmp_path: Path) -> None:
    path = tmp_path / "pieces.ply"
    write_cloud(path, sample_tube(LINE, 0.02, 5000, 3, gaps=[(0.3, 0.5)]).points)
    alone = run(path, "-o", tmp_path, "--json")
    assert json.loads(alone.stdout)["quality"]["verdict"] == "bad"
    for given in ("all", "1"):
        whole = run(path, "-o", tmp_path, "--force", "--json", "--bridge", given)
        quality = json.loads(whole.stdout)["quality"]
        assert quality["verdict"] == "good" and [item["code"] for item in quality["findings"]] == ["gap"]
        assert json.loads((tmp_path / "pieces.json").read_text())["length"] == pytest.approx(LINE.length, rel=0.02)
    refused = run(path, "-o", tmp_path, "--force", "--bridge", "some")
    assert refused.exit_code == 2 and "bridge = 'some'" in refused.stderr
