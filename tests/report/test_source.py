"""Contracts as written: every character is there, coloured, in its line, and none of it becomes markup."""

from __future__ import annotations

import html
import random
import re
from dataclasses import replace

import pytest
from assurance.sample import case, guarantee, rover_case, system

from avow.assurance.codec import from_json, to_json
from avow.assurance.model import Case, SourceView
from avow.base.files import sha256
from avow.pipeline import report_check as check
from avow.report import source
from avow.report.markdown import render_markdown
from report.hostile import hostile_case
from report.pages import all_claims, claim_pages
from report.test_page import Page

PATH = "contracts/rover/system.rcl"


def with_text(text: str, path: str = PATH) -> Case:
    return case(
        system({"n": ["g"]}), [guarantee("n", "g", line=2)], [], digests={path: sha256(text)}, sources={path: text}
    )


def shown(found: Case) -> list[str]:
    """The lines that a reader sees, without the marks beside them."""
    rows = re.findall(r"<div(?: id=\"[^\"]*\")?>(.*?)</div>", str(source.lines_of(found, 1)), re.S)
    plain = [re.sub(r'<a class="came.*?</a>', "", row) for row in rows]
    return [html.unescape(re.sub(r"<[^>]*>", "", row)) for row in plain]


ALPHABET = [
    *("/*", "*/", "//", '"', "\n", " ", "node", "guarantee", "(", ")", "forall", "<b>", "&amp;", "é", "∀", "'", "\\"),
    *(":", "-", "#", "|", "{", "}", "\t", "x" * 40, "[", "!", "%", "*", "0.5"),
]


@pytest.mark.parametrize("path", [PATH, "contracts/rover/plan.yaml"])
@pytest.mark.parametrize("seed", range(40))
def test_colouring_loses_and_adds_no_character(seed: int, path: str) -> None:
    rng = random.Random(seed)
    text = "".join(rng.choice(ALPHABET) for _ in range(rng.randrange(1, 300)))
    wanted = [line or " " for line in source.visible_lines(text)]
    assert shown(with_text(text, path)) == wanted


def test_comments_and_keywords_have_colours() -> None:
    text = str(source.lines_of(with_text("// <why>\nnode n{ guarantee(in.x > 0) }\n"), 1))
    assert '<span class="c">// &lt;why&gt;</span>' in text
    assert '<span class="k">node</span>' in text
    assert '<span class="v">in</span>' in text


def test_a_guarantee_shows_beside_its_line_and_links_both_ways() -> None:
    text = all_claims(with_text("// a\nguarantee g(TRUE)\n"))
    line = re.search(r'<div id="s1-2">(.*?)</div>', text)
    assert line
    assert 'href="node-n.html#rover/n/guarantee/g"' in line[1]
    assert "missing" in line[1]
    assert f'<a href="contracts.html#s1-2">{PATH}:2</a>' in text


def test_a_place_beyond_the_text_or_in_another_file_is_no_link() -> None:
    assert f"{PATH}:2 " in re.sub("<[^>]*>", " ", all_claims(with_text("one line")))
    assert "#s1-2" not in all_claims(with_text("one line"))
    assert "#s1-" not in all_claims(with_text("a\nb\nc", "contracts/other/system.rcl")).replace('id="s1-', "")


def test_what_cannot_be_seen_is_told() -> None:
    """A control of writing direction could make code look like a comment to whoever signs."""
    lines = shown(with_text("// \u202e } ;evil \u2066 // x\na\u200bb\r\nc\rd\n"))
    assert lines == ["// U+202E } ;evil U+2066 // x", "aU+200Bb", "cU+000Dd"]
    assert "\u202e" not in render_markdown(hostile_case()).rsplit("as written", 1)[1]


def test_hostile_comments_stay_text_on_the_page() -> None:
    page = Page(claim_pages(hostile_case())["contracts.html"])
    assert page.faults == []
    assert page.tags.count("script") == 1
    assert "b" not in {tag for tag, name, _ in page.attributes if name == "onerror"}
    assert not [
        tag for tag, name, value in page.attributes if tag == "img" and not value.startswith("data:") and name == "src"
    ]


def test_fences_in_markdown_are_longer_than_any_within() -> None:
    text = render_markdown(with_text("// ```` \n// ``````\n```\nnode\n"))
    fences = re.findall(r"^`{3,}.*$", text, re.M)
    assert fences[0] == "```````rcl"
    assert fences[-1] == "```````"


def test_a_very_long_contract_is_shown_without_colours_and_with_few_anchors() -> None:
    text = "".join(f"// comment number {n} of a contract that a program wrote\n" for n in range(12_000))
    shown_text = str(source.lines_of(with_text(text), 1))
    assert 'class="c"' not in shown_text
    assert re.findall(r'id="([^"]*)"', shown_text) == ["s1-2"]
    assert shown_text.count("<div") == 12_000
    assert len(shown_text) < 1.4 * len(text) + 1000


@pytest.mark.nightly
def test_colouring_takes_no_time_to_speak_of() -> None:
    """Texts that regular expressions like least."""
    import time

    began = time.process_time()
    for piece in ("/*", "/* *", '"', "- ", "? ", "{", "a: |\n  x\n", "'", "&a *b ", "((((", "x'", "1.", "!in "):
        for path in (PATH, "contracts/rover/plan.yaml"):
            source.lines_of(with_text(piece * (20_000 // len(piece)), path), 1)
    assert time.process_time() - began < 20


def test_another_text_than_the_digest_names_is_found() -> None:
    honest = rover_case()
    assert list(check._texts(honest)) == []
    first = replace(honest.sources[0], text=honest.sources[0].text.replace("line 3", "line 33"))
    assert any("not the one" in line for line in check._texts(replace(honest, sources=(first, *honest.sources[1:]))))
    stray = replace(honest, sources=(*honest.sources, SourceView("contracts/rover/more.rcl", "x")))
    assert any("no digest" in line for line in check._texts(stray))


def test_texts_survive_json_to_the_byte() -> None:
    found = with_text("\ufeff// a\r\n\tb\r\n\x00\u2028é\n")
    assert from_json(to_json(found)).sources == found.sources
