"""`acx4 import --help` lists the kinds by what they bring."""

from acx4book.command.exchange.importing import TITLES, app


def test_every_kind_has_its_place_in_the_help(acx4):
    status, said, _ = acx4("import", "--help")
    assert status == 0
    assert "Others" not in said
    for command in app.registered_commands:
        assert f"\n  {command.name} " in said
    assert f"{TITLES['trajectories']}:\n  sbet " in said
