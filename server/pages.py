"""The HTML pages, and the files they are made of: ours, and those out of installed wheels."""

import json
import re
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fastapi import APIRouter, FastAPI, Request, Response
from fastapi.responses import FileResponse, HTMLResponse
from fastapi.staticfiles import StaticFiles
from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape
from markupsafe import Markup
from starlette.types import Scope

from labs import plots
from labs.engine.catalog import CatalogEntry, catalog
from labs.params import Params
from server.articles import render, search_words
from server.experiments import PACES, WINDOWS
from server.formulas import tex_to_mathml

STATIC = Path(__file__).parent.parent / "static"

# What a page loads from installed packages: (package, distribution, file inside, media type).
VENDOR = {
    "uplot.js": ("uplot", "uplot-python", "static/uPlot.iife.js", "text/javascript"),
    "uplot.css": ("uplot", "uplot-python", "static/uPlot.min.css", "text/css"),
    "swagger.js": (
        "fastapi_offline",
        "fastapi-offline",
        "static/swagger-ui-bundle.js",
        "text/javascript",
    ),
    "swagger.css": ("fastapi_offline", "fastapi-offline", "static/swagger-ui.css", "text/css"),
    "stix.ttf": ("ziamath", "ziamath", "fonts/STIXTwoMath-Regular.ttf", "font/ttf"),
}

router = APIRouter(include_in_schema=False)


def install_pages(app: FastAPI) -> None:
    """Adds the pages and the static files to the application."""
    app.include_router(router)
    app.mount("/static", _StaticFiles(directory=STATIC), name="static")


def vendor_url(name: str) -> str:
    """Where a file from a wheel is served, from the root; a new version is a new address."""
    return f"vendor/{name}?v={version(VENDOR[name][1])}"


def package_version() -> str:
    try:
        return version("orclab")
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "checkout"


# Pages -------------------------------------------------------------------------------------


@router.get("/")
def home(request: Request) -> Response:
    return _page(request, "home.html", chapters=_chapters())


@router.get("/labs/{slug}")
def lab(request: Request, slug: str) -> Response:
    entry = catalog().get(slug)
    if entry is None:
        return not_found_page(request, f"No lab is called “{slug}”")
    entries = list(catalog().values())
    place = entries.index(entry)
    return _page(
        request,
        "lab.html",
        entry=entry,
        lab=entry.lab,
        article=render(entry),
        groups=_groups(entry.lab.Params),
        data=_script_json(lab_data(entry)),
        before=entries[place - 1] if place > 0 else None,
        after=entries[place + 1] if place + 1 < len(entries) else None,
    )


def not_found_page(request: Request, what: str) -> Response:
    """Says what was not found, and shows the labs there are."""
    return _page(request, "missing.html", 404, what=what, chapters=_chapters())


@router.get("/docs")
def docs(request: Request) -> Response:
    return _page(request, "docs.html")


@router.get("/labs/{slug}/picture.webp")
def picture(slug: str) -> Response:
    entry = catalog().get(slug)
    content = entry.picture if entry else None
    if content is None:
        return Response(status_code=404)
    return Response(content, media_type="image/webp", headers={"Cache-Control": "max-age=3600"})


@router.get("/favicon.ico")
def favicon() -> Response:
    return FileResponse(STATIC / "img" / "icon.svg", media_type="image/svg+xml")


@router.get("/vendor/{name}")
def vendor(name: str) -> Response:
    if name not in VENDOR:
        return Response(status_code=404)
    headers = {"Cache-Control": "public, max-age=31536000, immutable"}
    return FileResponse(_vendor_file(name), media_type=VENDOR[name][3], headers=headers)


# What pages are made of ----------------------------------------------------------------------


def lab_data(entry: CatalogEntry) -> dict[str, Any]:
    """Everything the page's scripts know about a lab."""
    lab = entry.lab
    return {
        "slug": entry.slug,
        "title": lab.title,
        "section": lab.section,
        "summary": lab.summary,
        "chapter": {"number": entry.chapter, "title": entry.chapter_title},
        "params": [_add_mathml(tunable) for tunable in lab.Params.describe()],
        "plots": [_add_mathml(plots.describe(plot)) for plot in lab.plots],
        "presets": {name: dict(values) for name, values in lab.presets.items()},
        "actions": [vars(action) for action in lab.actions],
        "experiments": [experiment.describe() for experiment in render(entry).experiments],
        "period": lab.period,
        "has_world": lab.has_world(),
        "has_solver": lab.has_solver(),
        "version": package_version(),
    }


def _add_mathml(data: dict[str, Any]) -> dict[str, Any]:
    """Adds to every symbol, also those of a plot's lines, its MathML."""
    if data.get("symbol"):
        data = data | {"mathml": tex_to_mathml(data["symbol"])}
    if data.get("lines"):
        data = data | {"lines": [_add_mathml(line) for line in data["lines"]]}
    return data


def _groups(params: type[Params]) -> list[tuple[str, list[dict[str, Any]]]]:
    """The tunables by heading, in the order of declaration: on top, without one, those that matter
    first. Each tells whether it acts at first."""
    groups: dict[str, list[dict[str, Any]]] = {"": []}
    for tunable in params.describe():
        heading = "" if tunable["key"] else tunable["group"] or "Parameters"
        acts = params().acts(tunable["name"])
        groups.setdefault(heading, []).append(_add_mathml(tunable) | {"acts": acts})
    return [(heading, tunables) for heading, tunables in groups.items() if tunables]


def _chapters() -> list[tuple[str, str, list[CatalogEntry]]]:
    """Chapters that have labs, in the order of the course."""
    chapters: dict[tuple[str, str], list[CatalogEntry]] = {}
    for entry in catalog().values():
        chapters.setdefault((entry.chapter, entry.chapter_title), []).append(entry)
    return [(number, title, entries) for (number, title), entries in chapters.items()]


def _page(request: Request, template: str, status: int = 200, **context: Any) -> HTMLResponse:
    # Relative, so that a page also works behind a proxy that puts it under a prefix.
    root = "../" * (request.scope["raw_path"].count(b"/") - 1) or "./"
    html = _templates().get_template(template).render(root=root, **context)
    policy = (
        "default-src 'self'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
        f"img-src 'self' data: blob:; connect-src 'self'{websocket_sources(request)}; "
        "frame-src 'self'; frame-ancestors 'self'; object-src 'none'; base-uri 'none'; "
        "form-action 'self'"
    )
    return HTMLResponse(
        html, status, {"Content-Security-Policy": policy, "Cache-Control": "no-cache"}
    )


def websocket_sources(request: Request) -> str:
    """What a page's policy says of the scene's and the stream's WebSockets, which are of this host:
    not every browser takes 'self' for them. Behind a proxy the host may have another name."""
    origins = request.app.state.settings.origins
    hosts = [request.headers.get("host", ""), *(origin.split("//")[1] for origin in origins)]
    sound = [host for host in hosts if re.fullmatch(r"[\w.:\[\]-]+", host)]
    return "".join(f" ws://{host} wss://{host}" for host in sound)


@cache
def _templates() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(STATIC / "templates"),
        autoescape=select_autoescape(["html"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals.update(vendor=vendor_url, version=package_version(), words=search_words)
    environment.globals.update(paces=PACES, windows=WINDOWS)
    environment.filters["tex"] = lambda source: Markup(tex_to_mathml(source))
    environment.filters["number"] = lambda value: f"{value:.6g}".replace("-", "\u2212")
    return environment


def _script_json(data: object) -> Markup:
    """JSON that may stand inside a <script> element: nothing in it can end the element."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)


@cache
def _vendor_file(name: str) -> Path:
    """A file of an installed package, found without importing the package."""
    package, _, inside, _ = VENDOR[name]
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise FileNotFoundError(f"the package {package} is not installed")
    return Path(spec.submodule_search_locations[0]) / inside


class _StaticFiles(StaticFiles):
    """Our own files: always asked for again, so that a new release shows at once."""

    def file_response(self, *args: Any, **kwargs: Any) -> Response:
        response = super().file_response(*args, **kwargs)
        response.headers["Cache-Control"] = "no-cache"
        return response

    async def get_response(self, path: str, scope: Scope) -> Response:
        if path.startswith("templates"):
            return Response(status_code=404)
        return await super().get_response(path, scope)
