"""Message definitions: our reader of .msg texts against the one of rosbags, on every type of the common packages."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from avow.base.diagnostics import Malformed
from avow.ros.definitions import Array, Definitions, Nested, Scalar, parse_message, parse_parts
from avow.ros.sources import DISTRIBUTIONS, definitions, distribution


@pytest.mark.parametrize("distro", ["noetic", "foxy", "humble", "jazzy", "lyrical"])
def test_every_common_type_is_read_as_rosbags_reads_it(distro: str) -> None:
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores(DISTRIBUTIONS[distro]))
    known = distribution(distro)
    whole = Definitions(known)
    assert len(known) > 140
    for name in store.fielddefs:
        text, _ = store.generate_msgdef(name, ros_version=1 if distro == "noetic" else 2)
        ours = parse_message(re.split(r"^=+$", text, flags=re.MULTILINE)[0], name.replace("/msg/", "/"))
        assert ours == known[ours.name]
        assert whole.missing(ours) == ()


def test_the_forms_of_a_message() -> None:
    text = """
    # a comment
    uint8 OK = 0            # the rest is a comment
    string NAME= as # it is
    int32 X=-12
    Header header
    float32[] ranges
    geometry_msgs/Point[4] corners
    string<=10 word "a=b"
    int8[<=3] few [1, 2]
    Other other
    time at
    builtin_interfaces/Duration took
    char c
    """
    found = parse_message(text, "p/M")
    assert {f.name: str(f.wire) for f in found.fields} == {
        "header": "std_msgs/Header",
        "ranges": "float32[]",
        "corners": "geometry_msgs/Point[4]",
        "word": "string",
        "few": "int8[]",
        "other": "p/Other",
        "at": "time",
        "took": "duration",
        "c": "uint8",
    }
    assert found.constants == (("OK", "uint8", "0"), ("NAME", "string", "as # it is"), ("X", "int32", "-12"))
    assert found.fields[2].wire == Array(Nested("geometry_msgs/Point"), 4)
    assert Definitions({}).missing(found) == ("std_msgs/Header", "geometry_msgs/Point", "p/Other")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("float64 kg;", 1),
        ("float64 kg ;", 1),
        ("float64 load // in kg", 1),
        ("uint8 OPEN=300", 1),
        ("int8 UP=\nint8 x", 1),
        ("bool B=maybe", 1),
        ("float32 F=1,5", 1),
        ("int32", 1),
        ("int32 x\nfloat64 x", 2),
        ("p/T X=3", 1),
        ("int32 x y\n\n?? z", 3),
    ],
)
def test_what_is_no_definition_is_located(text: str, line: int) -> None:
    with pytest.raises(Malformed) as caught:
        parse_message(text, "p/M")
    assert caught.value.line == line


def test_services_and_actions_are_their_parts() -> None:
    request, response, event = parse_parts("int32 a\n---\nbool ok\n", "p/Do", "srv")
    assert (request.name, response.name, event.name) == ("p/Do_Request", "p/Do_Response", "p/Do_Event")
    assert response.fields[0].wire == Scalar("bool")
    assert [m.name for m in parse_parts("int32 a\n---\n---\nint32 b", "p/Go", "action")] == [
        "p/Go_Goal",
        "p/Go_Result",
        "p/Go_Feedback",
        "p/Go_SendGoal_Request",
        "p/Go_SendGoal_Response",
        "p/Go_GetResult_Request",
        "p/Go_GetResult_Response",
        "p/Go_FeedbackMessage",
    ]
    with pytest.raises(Malformed, match="2 parts"):
        parse_parts("int32 a", "p/Do", "srv")
    with pytest.raises(Malformed, match="2 parts") as caught:
        parse_parts("int32 a\n--\nbool b\n", "p/Do", "srv")
    assert caught.value.line == 2, "the line that was meant to set them apart"
    with pytest.raises(Malformed) as caught:
        parse_parts("int32 a\n---\n? b", "p/Do", "srv")
    assert caught.value.line == 3


def test_files_are_found_and_their_faults_located(tmp_path: Path) -> None:
    for name, text in (
        ("one/msg/A.msg", "int32 x"),
        ("one/msg/B.msg", "A a"),
        ("two/one/msg/A.msg", "int32 y"),
        ("one/srv/Do.srv", "A a\n---\n"),
        ("one/msg/Bad.msg", "int32"),
        ("one/README.md", "no definition"),
        ("three/msgs/C.msg", "int32 x"),
        ("three/msgs/D.msg", "int32 x"),
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    known, faults = definitions([tmp_path], None)
    assert {"one/A", "one/B", "one/Do_Request", "one/Do_Response", "std_msgs/Float64"} <= set(known.messages)
    assert sorted(d.code for d in faults) == ["ROS101", "ROS101", "ROS102"]
    assert [d.hint for d in faults if "three" in d.message] == ["rename it to `msg`"]
    assert all(d.span is not None for d in faults)


def test_idl(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    path = tmp_path / "p" / "msg" / "V.idl"
    path.parent.mkdir(parents=True)
    path.write_text(
        "module p { module msg { struct V { double x; sequence<float> r; uint8 k; string<4> s; }; }; };",
        encoding="utf-8",
    )
    known, faults = definitions([tmp_path], None)
    assert faults == ()
    message = known.get("p/msg/V")
    assert message is not None
    assert {f.name: str(f.wire) for f in message.fields} == {
        "x": "float64",
        "r": "float32[]",
        "k": "uint8",
        "s": "string",
    }
    path.write_text("module p {", encoding="utf-8")
    assert [d.code for d in definitions([tmp_path], None)[1]] == ["ROS101"]
