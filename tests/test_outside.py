"""Files that a model or a data set names lie in its folder, are regular and bounded; refusals quote no others."""

import gzip
import io
import os
import re
import resource
import shutil
import zipfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rover_pin import RoverPinError, Trace, close_the_loop, load_rover, scenario
from rover_pin.base.errors import DataError, UrdfError
from rover_pin.base.files.bounded import MIB, arrays
from rover_pin.base.trust import Trust
from rover_pin.cli.app import app
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.loop.close import read_data
from rover_pin.loop.data_check import measured_in
from rover_pin.rover.description.layout import rover_folder
from rover_pin.rover.urdf_check import check_urdf
from rover_pin.simulation.model.toml_file import read_model, write_model
from rover_pin.simulation.trace.files import write_parquet
from rover_pin.terrain import files
from rover_pin.view.film import mesh_folder
from rover_pin.view.triangles import shapes_of

RIG = Path(__file__).parents[1] / "studies" / "data" / "cmu-smooth-wheel"
SECRET = "root:x:0:0:secret"
RUN = "t_s,duty_fl,body_x\n0.0,0.5,0.0\n1.0,0.5,0.1\n"
GROUND = "x_m,z_m\n-1,0\n1,0\n"


@pytest.fixture
def outside(tmp_path):
    """A folder of someone else, with what a set could name."""
    folder = tmp_path / "outside"
    folder.mkdir()
    (folder / "passwd").write_text(f"{SECRET}\n{SECRET}\n")
    (folder / "run.csv").write_text(RUN)
    (folder / "ground.csv").write_text(GROUND)
    for file in (*RIG.iterdir(), *rover_folder().iterdir()):
        if file.is_file():
            shutil.copy(file, folder)
    return folder


def drive_log(folder, run="run.csv", terrain='polyline = "ground.csv"', rover="nexus6"):
    folder.mkdir(exist_ok=True)
    (folder / "run.csv").write_text(RUN)
    (folder / "ground.csv").write_text(GROUND)
    (folder / "drive.toml").write_text(
        f'kind = "drive-log"\nname = "log"\nrover = "{rover}"\n[terrain]\n{terrain}\n[[run]]\nfile = "{run}"\n'
    )
    return folder


def rig(folder, key, name):
    shutil.copytree(RIG, folder, dirs_exist_ok=True)
    file = folder / "rig.toml"
    files = {"points": "points.csv", "penetration": "penetration.csv"}
    text = file.read_text().replace(f'{key} = "{files[key]}"', f'{key} = "{name}"')
    assert f'{key} = "{name}"' in text
    file.write_text(text)
    return folder


def model(folder, terrain):
    path = write_model(scenario("flat").model, folder / "model.toml", with_terrain=True)
    path.write_text(path.read_text().replace('polyline = "terrain.csv"', terrain))
    return path


def rover(folder, urdf):
    folder.mkdir(exist_ok=True)
    toml = folder / "own.toml"
    toml.write_text((rover_folder() / "nexus6.toml").read_text().replace('"nexus6.urdf"', f'"{urdf}"'))
    return toml


WAYS = {
    "run": (lambda to, name, trust=Trust(): read_drive_log(drive_log(to, run=name), trust), "run.csv"),
    "polyline": (
        lambda to, name, trust=Trust(): read_drive_log(drive_log(to, terrain=f'polyline = "{name}"'), trust).terrain(),
        "ground.csv",
    ),
    "polylines": (
        lambda to, name, trust=Trust(): read_drive_log(
            drive_log(to, terrain=f'polylines = ["ground.csv", "{name}"]\nborders = [0.0]'), trust
        ).terrain(),
        "ground.csv",
    ),
    "points": (lambda to, name, trust=Trust(): read_data(rig(to, "points", name), trust), "points.csv"),
    "points of a fit": (lambda to, name, trust=Trust(): measured_in(rig(to, "points", name), trust), "points.csv"),
    "penetration": (lambda to, name, trust=Trust(): read_data(rig(to, "penetration", name), trust), "penetration.csv"),
    "terrain of a model": (
        lambda to, name, trust=Trust(): read_model(model(to, f'polyline = "{name}"'), trust=trust),
        "ground.csv",
    ),
    "URDF": (lambda to, name, trust=Trust(): load_rover(rover(to, name), trust), "nexus6.urdf"),
}


@pytest.mark.parametrize("way", WAYS)
def test_a_file_elsewhere_needs_trust(way, outside, tmp_path):
    read, name = WAYS[way]
    for at, inputs in enumerate((f"../outside/{name}", str(outside / name), f"below/../../outside/{name}")):
        with pytest.raises(RoverPinError, match=r".*:.*--trust"):
            read(tmp_path / f"set{at}", inputs)
    assert read(tmp_path / "trusted", f"../outside/{name}", Trust(everything=True))


@pytest.mark.parametrize("way", WAYS)
def test_a_link_is_where_it_leads(way, outside, tmp_path):
    read, name = WAYS[way]
    folder = tmp_path / "set"
    folder.mkdir()
    (folder / "link.csv").symlink_to(outside / name)
    with pytest.raises(RoverPinError, match="lies outside"):
        read(folder, "link.csv")


def test_a_rover_may_lie_elsewhere(outside, tmp_path):
    """Sets share rovers: that of another folder is read, and a file that is none is not quoted."""
    log = read_drive_log(drive_log(tmp_path / "set", rover="../outside/nexus6.toml"))
    assert log.load_rover().name == "nexus6"
    (outside / "secret.toml").write_text(f'password = "{SECRET}"\n')
    for name in ("../outside/secret.toml", str(outside / "secret.toml"), "../outside/passwd"):
        log = read_drive_log(drive_log(tmp_path / "set", rover=name))
        with pytest.raises(UrdfError) as raised:
            log.load_rover()
        assert SECRET not in str(raised.value)
        assert "password" not in str(raised.value)
    log = read_drive_log(drive_log(tmp_path / "set", rover="../outside/secret.toml"))
    with pytest.raises(UrdfError, match="`rover-pin check-urdf`"):
        log.load_rover()


@pytest.mark.parametrize(
    "entity",
    ['<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">', '<!ENTITY b SYSTEM "file:///etc/passwd">', '<!ENTITY % b SYSTEM "x">'],
)
def test_a_urdf_has_no_entities(entity, tmp_path):
    toml = rover(tmp_path / "own", "own.urdf")
    text = (rover_folder() / "nexus6.urdf").read_text()
    head, robot, tail = text.partition("<robot")
    (toml.parent / "own.urdf").write_text(f"{head}<!DOCTYPE robot [{entity}]>{robot}{tail}")
    with pytest.raises(UrdfError, match=r"<!DOCTYPE>.*<!ENTITY>"):
        load_rover(toml)
    assert not check_urdf(toml).ok


def test_meshes_are_never_opened(tmp_path):
    """An endless mesh would hang who reads it; of a pipe nothing could be read."""
    toml = rover(tmp_path / "own", "own.urdf")
    os.mkfifo(tmp_path / "own" / "mesh.stl")
    mesh = '<visual><geometry><mesh filename="mesh.stl"/></geometry></visual>'
    absolute = '<visual><geometry><mesh filename="file:///dev/zero"/></geometry></visual>'
    text = (rover_folder() / "nexus6.urdf").read_text()
    (toml.parent / "own.urdf").write_text(text.replace("</link>", f"{mesh}{absolute}</link>", 1))
    assert load_rover(toml).name == "nexus6"


def test_large_descriptions_are_refused(tmp_path):
    file = tmp_path / "drive.toml"
    with file.open("wb") as opened:
        opened.truncate(1 << 33)
    with pytest.raises(DataError, match=r"it.*2 MiB"):
        read_drive_log(tmp_path)
    toml = rover(tmp_path / "own", "own.urdf")
    with (tmp_path / "own" / "own.urdf").open("wb") as opened:
        opened.truncate(1 << 33)
    with pytest.raises(UrdfError, match=r"it.*16 MiB"):
        load_rover(toml)


def test_large_tables_are_refused(tmp_path, monkeypatch):
    folder = drive_log(tmp_path / "set")
    with (folder / "run.csv").open("r+b") as opened:
        opened.truncate(1 << 33)
    with pytest.raises(DataError, match=r"run\.csv:.*256 MiB"):
        read_drive_log(folder)
    with (rig(tmp_path / "rig", "points", "points.csv") / "points.csv").open("r+b") as opened:
        opened.truncate(1 << 33)
    with pytest.raises(DataError, match=r"it.*256 MiB"):
        measured_in(tmp_path / "rig")
    np.savez_compressed(tmp_path / "set" / "grid.npz", x0=0, y0=0, dx=1, dy=1, z=np.zeros((2_000, 1_000)))
    monkeypatch.setattr(files, "arrays", partial(arrays, max_bytes=8 * MIB))
    log = read_drive_log(drive_log(tmp_path / "set", terrain='grid = "grid.npz"'))
    with pytest.raises(DataError, match=r"grid\.npz:.*8 MiB"):
        log.terrain()


def test_the_commands_take_trust(tmp_path, outside, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = rig(tmp_path / "set", "points", "../outside/points.csv")
    words = ["identify", str(folder), "--json"]
    assert isinstance(CliRunner().invoke(app, words).exception, DataError)
    assert CliRunner().invoke(app, [*words, "--trust"]).exit_code == 0
    with pytest.raises(DataError, match="lies outside"):
        close_the_loop(folder)
    assert read_data(folder, Trust(everything=True)).slip.size


def refused(words, folder, monkeypatch):
    """What a command says that is given in this folder and refused."""
    monkeypatch.chdir(folder)
    done = CliRunner().invoke(app, words)
    assert isinstance(done.exception, RoverPinError), done.output
    assert SECRET not in str(done.exception)
    assert "root" not in str(done.exception).replace(str(folder.parent), "")
    return str(done.exception)


SETTINGS = ("terrain.path", "model", "rover")
STUDIES = {
    "sweep": 'name = "s"\nscenario = "polyline"\nplan = { kind = "grid" }\n[parameters]\nsoil.k = [0.01]\n[settings]\n',
    "tune": '[[training]]\nscenario = "polyline"\n',
}


@pytest.mark.parametrize("command", STUDIES)
@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("name", ["../outside/passwd", "/etc/passwd", "link"])
def test_a_study_names_no_file_elsewhere(command, setting, name, outside, tmp_path, monkeypatch):
    folder = tmp_path / "set"
    folder.mkdir()
    (folder / "link").symlink_to(outside / "passwd")
    (folder / "study.toml").write_text(f'{STUDIES[command]}{setting} = "{name}"\n')
    message = refused([command, "study.toml"], folder, monkeypatch)
    assert "give --trust" in message


@pytest.mark.parametrize("command", ["view", "export"])
@pytest.mark.parametrize("setting", SETTINGS)
def test_a_trace_names_no_file_elsewhere(command, setting, outside, tmp_path, monkeypatch):
    folder = tmp_path / "set"
    folder.mkdir()
    channels = {"t_s": np.array([0.0, 1.0])}
    trace = Trace(
        channels, attrs={"scenario": "polyline", "settings": {setting: str(outside / "passwd"), "trust": True}}
    )
    write_parquet(folder / "drive.parquet", trace)
    message = refused([command, "drive.parquet"], folder, monkeypatch)
    assert message.startswith(f"drive.parquet: {setting} = ")
    assert "lies outside" in message


def meshed(folder, name):
    """The cart, whose wheels are drawn by a mesh, as a URDF and a TOML in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    urdf = (rover_folder() / "cart.urdf").read_text()
    file = folder / "cart.urdf"
    file.write_text(
        re.sub(r"<geometry><cylinder.*?</geometry>", f'<geometry><mesh filename="{name}"/></geometry>', urdf)
    )
    shutil.copy(rover_folder() / "cart.toml", folder / "own.toml")
    return file


def packed(mib):
    """A small archive of a large STL."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("wheel.stl", bytes(80) + (mib * MIB // 50).to_bytes(4, "little") + bytes(mib * MIB // 50 * 50))
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("wheel.obj", "usemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -3\n"),
        ("wheel.stl", "solid a\nfacet normal 0 0 1\nouter loop\nendloop\nendfacet\nendsolid a\n"),
        ("wheel.dae", '<COLLADA/><node><instance_geometry url="#g"/></node>'),
    ],
)
def test_no_mesh_of_many_parts_takes_minutes(name, part, tmp_path, monkeypatch, caplog):
    """3.5 MB of OBJ in 60,000 parts took more than 200 s."""
    monkeypatch.chdir(tmp_path)
    meshed(tmp_path, name)
    (tmp_path / name).write_text(1001 * part)
    assert CliRunner().invoke(app, ["new-rover", "cart.urdf", "--out", "new/own.toml"]).exit_code == 0
    assert re.search(rf"{re.escape(name)}: .*1000", caplog.text)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("wheel.zip", packed(128)),
        ("wheel.3mf", packed(128)),
        ("wheel.stl", packed(128)),
        ("wheel.obj", packed(128)),
        ("wheel.obj.gz", gzip.compress(bytes(128 * MIB), 1)),
        ("wheel.dae", b'<!DOCTYPE x [<!ENTITY a "aaaa">]><COLLADA>&a;</COLLADA>'),
        (
            "wheel.dae",
            b'<COLLADA><library_nodes><node id="a"><instance_node url="#b"/></node></library_nodes></COLLADA>',
        ),
        (
            "wheel.ply",
            b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty double x\nend_header\n",
        ),
        ("wheel.ply", b"ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty double x\nend_header\n1\n"),
    ],
)
def test_no_mesh_unpacks_to_more_than_it_is(name, content, tmp_path, monkeypatch, caplog):
    monkeypatch.chdir(tmp_path)
    file = meshed(tmp_path, name)
    (tmp_path / name).write_bytes(content)
    load_rover(tmp_path / "own.toml")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert CliRunner().invoke(app, ["new-rover", str(file), "--out", "new/own.toml"]).exit_code == 0
    shapes_of(load_rover(tmp_path / "own.toml"), tmp_path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak < 128 * 1024
    assert name in caplog.text


@pytest.mark.slow
@pytest.mark.parametrize("marked", [True, False])
@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("package://pkg/meshes/wheel.obj", True),
        ("../meshes/wheel.obj", True),
        ("../../outside/wheel.obj", False),
        ("ABSOLUTE", False),
        ("file://ABSOLUTE", False),
        ("package://outside/wheel.obj", False),
        ("link.obj", False),
    ],
)
def test_a_mesh_lies_in_the_package_of_its_urdf(name, read, marked, tmp_path, monkeypatch):
    """The package is the folder of package.xml, or else the parent of `urdf`; the TOML may lie elsewhere in it."""
    import trimesh

    wheel = trimesh.creation.cylinder(
        radius=0.3, height=0.1, transform=trimesh.transformations.rotation_matrix(0, [1, 0, 0])
    )
    for folder in ("outside", "pkg/meshes"):
        (tmp_path / folder).mkdir(parents=True)
        wheel.export(tmp_path / folder / "wheel.obj")
    if marked:
        (tmp_path / "pkg" / "package.xml").touch()
    file = meshed(tmp_path / "pkg" / "urdf", name.replace("ABSOLUTE", str(tmp_path / "outside" / "wheel.obj")))
    (file.parent / "link.obj").symlink_to(tmp_path / "outside" / "wheel.obj")
    monkeypatch.chdir(tmp_path)
    assert CliRunner().invoke(app, ["new-rover", str(file), "--out", "new/own.toml"]).exit_code == 0
    assert ("r = 0.3 " in (tmp_path / "new" / "own.toml").read_text()) is read
    toml = tmp_path / "pkg" / "own.toml"
    toml.write_text((file.parent / "own.toml").read_text().replace('"cart.urdf"', '"urdf/cart.urdf"'))
    drawn = [mount for mount in shapes_of(load_rover(toml), mesh_folder(str(toml))) if mount.wheel]
    assert np.ptp(drawn[0].vertices[:, 0]) == pytest.approx(0.6 if read else 0.22, rel=0.01)
    missing = [note for note in check_urdf(toml).notes if "1 of 1 meshes" in note]
    assert len(missing) == (not read)
    assert all("'pkg'" in note and ".obj" in note for note in missing)


@pytest.mark.parametrize("name", ["", "a\\u0000b", "x" * 5000, "loop", "."])
def test_impossible_names(name, tmp_path):
    for way, (read, _) in WAYS.items():
        folder = tmp_path / way
        folder.mkdir()
        (folder / "loop").symlink_to(folder / "loop")
        with pytest.raises(RoverPinError) as raised:
            read(folder, name)
        assert len(str(raised.value).splitlines()) == 1
