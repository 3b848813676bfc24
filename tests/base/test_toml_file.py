"""A TOML file is read in time and memory that its size bounds, whatever its keys are."""

import time
import tracemalloc

import pytest

from rover_pin.base.errors import DataError
from rover_pin.base.files.toml_file import MAX_KEY_PARTS, MAX_TOML, read_toml


@pytest.fixture
def toml(tmp_path):
    def write(text):
        (tmp_path / "a.toml").write_text(text)
        return tmp_path / "a.toml"

    return write


@pytest.mark.parametrize("name", ["a", '"a b"', "'a'"])
@pytest.mark.parametrize("form", ["{} = 1", "[{}]", "[[{}]]", "x = {{ {} = 1 }}"])
@pytest.mark.parametrize("join", [".", " . "])
def test_the_depth_of_a_key_is_limited_before_parsing(toml, name, form, join):
    """20,000 names took 2 GB; the refusal takes neither time nor memory, and names the line."""
    assert read_toml(toml(form.format(join.join([name] * MAX_KEY_PARTS)))) != {}
    file = toml("y = '''\n\n'''\n" + form.format(join.join([name] * 20_000)))
    begin = time.process_time()
    tracemalloc.start()
    with pytest.raises(DataError, match=rf"line 4: .*{MAX_KEY_PARTS}"):
        read_toml(file)
    assert tracemalloc.get_traced_memory()[1] < 4e6
    tracemalloc.stop()
    assert time.process_time() - begin < 2.0


def test_dots_in_texts_and_comments_are_no_keys(toml):
    many = "a." * 40
    text = (
        f'x = "{many}\\"{many}" # {many}\ny = \'{many}\'\nz = \'\'\'{many}\n\'{many}\'\'\'\nw = """{many}\n"{many}"""\n'
    )
    content = read_toml(toml(text))
    assert content == {"x": f'{many}"{many}', "y": many, "z": f"{many}\n'{many}", "w": f'{many}\n"{many}'}


@pytest.mark.parametrize("filler", ["a", " ", "#", '"', "'", "a.", "\\", "[", '"""', "\n"])
def test_no_text_makes_the_check_slow(toml, filler):
    """The largest file that is allowed, of one mark only."""
    file = toml(filler * (MAX_TOML // len(filler)))
    begin = time.process_time()
    try:
        assert read_toml(file) == {}
    except DataError as error:
        assert "a.toml" in str(error)  # noqa: PT017
    assert time.process_time() - begin < 10.0


def test_a_larger_file_is_refused(toml):
    with pytest.raises(DataError, match="2 MiB"):
        read_toml(toml("#" * (MAX_TOML + 1)))
