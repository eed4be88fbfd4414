import pytest

from service.service_settings import ServiceSettings
from simulator.errors import InvalidInputError


def test_defaults_need_nothing() -> None:
    assert ServiceSettings.from_environment({}) == ServiceSettings()


def test_reads_its_prefix_alone() -> None:
    given = {"HYBRIDTOF_WORKERS": "3", "HYBRIDTOF_SHUTDOWN_S": "1.5", "WORKERS": "9"}
    settings = ServiceSettings.from_environment(given)
    assert (settings.workers, settings.shutdown_s) == (3, 1.5)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("WORKERS", "0"),
        ("WORKERS", "two"),
        ("SHUTDOWN_S", "nan"),
        ("SHUTDOWN_S", "60"),
        ("TYPO", "1"),
    ],
)
def test_names_the_variable(name: str, value: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        ServiceSettings.from_environment({f"HYBRIDTOF_{name}": value})
    assert [p.pointer for p in caught.value.problems] == [f"/HYBRIDTOF_{name}"]
