"""What is said on a terminal cannot move, colour or hide anything there."""

import io

import pytest

from acx4book.command import terminal
from acx4book.typesetting import plain_text


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("plain: größe, Kamera №1, σ = 3″", None),
        ("カメラ 相机 камера", None),
        ("a\u00a0b", None),
        ("\x1b[31mred\x1b[0m", r"\x1b[31mred\x1b[0m"),
        ("over\rwritten", r"over\rwritten"),
        ("two\nlines", r"two\nlines"),
        ("tab\there\x07", r"tab\there\x07"),
        ("\x9b1A", r"\x9b1A"),
        ("abc\u202exe.txt", r"abc\u202exe.txt"),
        ("line\u2028separator", r"line\u2028separator"),
        ("byte \udcff", r"byte \xff"),
    ],
)
def test_a_line_stays_a_line_of_signs(line, shown):
    assert plain_text.shown(line, "terminal") == (line if shown is None else shown)


def test_standard_error_gets_safe_lines(capsys):
    terminal.say("a\x1b[2J", "b\nc")
    assert capsys.readouterr().err == "a\\x1b[2J\nb\\nc\n"


def test_a_text_keeps_its_lines(capsys):
    terminal.show("one\ntwo\x1b[1m")
    assert capsys.readouterr().out == "one\ntwo\\x1b[1m\n"


class Screen(io.StringIO):
    """A terminal."""

    def isatty(self):
        return True


@pytest.mark.parametrize("bars", [terminal.stage_bars, terminal.counting_bar])
def test_a_name_in_a_bar_is_no_markup(monkeypatch, bars):
    screen = Screen()
    monkeypatch.setattr("sys.stdout", screen)
    with bars("rows") as tell:
        tell("[/bold] [link=http://x]a[/link]\x1b[2J", 1, 2)
        tell("[/bold] [link=http://x]a[/link]\x1b[2J", 2, 2)
    assert "\x1b[2J" not in screen.getvalue()
    assert "\x1b]8" not in screen.getvalue()  # a link
    assert "http" not in screen.getvalue() or "[link=http://x]" in screen.getvalue()
