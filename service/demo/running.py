"""The service in a process of its own, and a client of it."""

import contextlib
import dataclasses
import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from typing import Any

import httpx

from service.errors import ServiceError
from service.service_settings import PREFIX

__all__ = ["Client", "DemoError", "running_service"]

_ADDRESS = re.compile(r"running on (http://\S+)")


class DemoError(ServiceError):
    """The service does not start, or refuses what it was made to answer."""


@contextlib.contextmanager
def running_service() -> Iterator[str]:
    """Serve on a port that the system picks, and end the service afterwards.

    Yields
    ------
    str
        Its address.

    Raises
    ------
    DemoError
        Where it does not start, with what it said.
    """
    # settings of somebody else's service are not meant for this one
    environment = {k: v for k, v in os.environ.items() if not k.startswith(PREFIX)}
    environment[f"{PREFIX}WARM"] = "off"  # it is there for these few questions
    command = [sys.executable, "-m", "service.cli", "serve", "--port", "0"]
    process = subprocess.Popen(  # noqa: S603  # a fixed command
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment
    )
    assert process.stderr is not None  # noqa: S101  # asked for above
    said: list[str] = []
    drain = threading.Thread(target=process.stderr.read, daemon=True)
    try:
        for line in process.stderr:
            said.append(line)
            if found := _ADDRESS.search(line):
                break
        else:
            raise DemoError("the service does not start:\n" + "".join(said))
        # a full pipe would halt the service
        drain.start()
        yield found[1]
    finally:
        process.terminate()
        try:
            process.wait(timeout=15)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if drain.is_alive():
            drain.join(timeout=15)
        if not drain.is_alive():  # what somebody else still writes to cannot be closed
            process.stderr.close()


@dataclasses.dataclass(frozen=True)
class Client:
    """What the demo asks of the service."""

    http: httpx.Client

    def post(self, path: str, body: dict[str, Any]) -> dict[str, Any]:
        """Send a request.

        Raises
        ------
        DemoError
            Where it is refused, with the service's words.
        """
        response = self.http.post(path, json=body)
        if response.is_error:
            raise DemoError(f"POST {path}: {response.status_code} {response.text}")
        answer: dict[str, Any] = response.json()
        return answer

    def posteriors(self, bodies: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
        """Ask for posteriors, all at once, and wait for them.

        Raises
        ------
        DemoError
            Where one fails.
        """
        asked = [self.post("/v1/posteriors", body) for body in bodies]
        return [self._ended(answer) for answer in asked]

    def _ended(self, answer: dict[str, Any]) -> dict[str, Any]:
        address = f"/v1/posteriors/{answer['id']}"
        while answer["status"] in ("queued", "running"):
            # events of it end as it does
            with self.http.stream("GET", f"{address}/events") as events:
                events.raise_for_status()
                for _ in events.iter_lines():
                    pass
            answer = self.http.get(address).raise_for_status().json()
        if answer["status"] != "done":
            raise DemoError(f"the posterior is {answer['status']}: {answer.get('problem')}")
        return answer
