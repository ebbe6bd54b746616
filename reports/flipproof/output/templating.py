"""The one way in which pages are made of templates: escaped by themselves, and a name that is missing is an error."""

from __future__ import annotations

from jinja2 import Environment, PackageLoader, StrictUndefined

from flipproof.figures.spoken import spoken
from flipproof.output.inline import data_uri, shape


def environment() -> Environment:
    """Return a fresh environment over the package's templates."""
    templates = Environment(
        loader=PackageLoader("flipproof.page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters |= {"spoken": spoken, "data_uri": data_uri, "shape": shape}
    return templates
