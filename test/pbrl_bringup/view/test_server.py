"""The server answers this machine under its own names only, and lets a page load nothing from elsewhere."""

from __future__ import annotations

import http.client
import json
import re
import socket
import sys
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from pbrl_bringup.errors import BringupError
from pbrl_bringup.view.bag import BagSource
from pbrl_bringup.view.server import make_app
from pbrl_bringup.view.serving import ADDRESS, listening
from pbrl_bringup.view.shown import shown_of

sys.path.insert(0, str(Path(__file__).parent))
from view_kit import EVIL, recorded, serving


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with serving(make_app(BagSource(shown_of(recorded(EVIL), EVIL)))) as found:
        yield found


def asked(address: str, path: str, host: str | None = None, method: str = "GET") -> tuple[int, dict[str, str], bytes]:
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(ADDRESS, parts.port or 0, timeout=20)
    connection.request(method, path, headers={} if host is None else {"Host": host})
    answer = connection.getresponse()
    found = answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()
    connection.close()
    return found


def test_it_listens_on_loopback_only() -> None:
    with listening(0) as at:
        assert at.getsockname()[0] == "127.0.0.1"
        with pytest.raises(BringupError, match="choose another"):
            listening(at.getsockname()[1])


def test_other_addresses_of_this_machine_get_no_answer(address: str) -> None:
    port = urlsplit(address).port
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.2", port), timeout=2)


@pytest.mark.parametrize("path", ["/", "/view.js", "/data", "/detail?from=0&to=1&most=10", "/events", "/nothing"])
def test_every_answer_is_guarded_and_strangers_get_none(address: str, path: str) -> None:
    _, headers, _ = asked(address, path)
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy and "unsafe" not in policy and "http" not in policy and "*" not in policy
    assert headers["x-content-type-options"] == "nosniff" and headers["cross-origin-resource-policy"] == "same-origin"
    for host in ("evil.example", "evil.example:80", "127.0.0.1.evil.example", "localhost.evil.example", "", "0.0.0.0"):
        status, headers, body = asked(address, path, host)
        assert status == 400 and b"table" not in body and "content-security-policy" in headers
    assert asked(address, path, f"localhost:{urlsplit(address).port}")[0] in (200, 404)


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS"])
def test_nothing_can_be_changed(address: str, method: str) -> None:
    assert asked(address, "/data", method=method)[0] == 405


@pytest.mark.parametrize(
    "query",
    ["", "from=0", "from=a&to=1&most=9", "from=nan&to=1&most=9", "from=2&to=1&most=9", "from=0&to=inf&most=9",
     "from=0&to=1&most=1", "from=0&to=1&most=99999999", "from=0&to=1&most=9.5", "from=<script>&to=1&most=9"],
)  # fmt: skip
def test_a_wrong_interval_is_told(address: str, query: str) -> None:
    status, headers, body = asked(address, f"/detail?{query}")
    assert status == 400 and b"expected from <= to" in body and headers["content-type"].startswith("text/plain")


def test_page_and_scripts_refer_to_nothing_outside(address: str) -> None:
    for path in ("/", "/view.js", "/view.css"):
        status, _, body = asked(address, path)
        text = body.decode()
        assert status == 200 and "http" not in text.lower() and "//" not in re.sub(r"(?m)//[^\n]*$", "", text)
        assert "innerHTML" not in text and "insertAdjacentHTML" not in text and "eval(" not in text
    page = asked(address, "/")[2].decode()
    assert "<style" not in page and re.findall(r"<script(?! src=)", page) == [] and " style=" not in page


def test_names_are_data(address: str) -> None:
    _, headers, body = asked(address, "/data")
    assert headers["content-type"] == "application/json"
    data = json.loads(body)
    assert data["title"] == EVIL and EVIL in [each["name"] for each in data["objects"]]
    assert EVIL.encode() not in asked(address, "/")[2]


def test_details_are_finer_than_the_first_picture(address: str) -> None:
    _, _, body = asked(address, "/detail?from=3&to=4&most=1000")
    wrench = json.loads(body)["wrenches"][0]
    assert 100 <= len(wrench["time"]) <= 103 and wrench["high"] is None
