"""Image files of a report, each with what a page needs to show it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from app.evaluation.report.film import film_grid, write_gif
from app.evaluation.report.theme import THEMES, Draw, save
from app.sim.rendering import RgbImage

JPEG_QUALITY = 85
IMAGES = "images"


@dataclass(frozen=True)
class Picture:
    """An image file.

    Attributes:
        src: the path relative to the page.
        alt: what is to be seen, for those who do not see it.
        dark_src: the same for dark pages, where that differs.
    """

    src: str
    alt: str
    width_px: int
    height_px: int
    dark_src: str | None = None


class PictureFolder:
    """Writes images into the folder `images` beside the page; names are file names without suffix."""

    def __init__(self, report: Path) -> None:
        self._report = report
        (report / IMAGES).mkdir(parents=True, exist_ok=True)

    def photo(self, name: str, image: RgbImage, alt: str) -> Picture:
        """A JPEG."""
        path = self._path(f"{name}.jpg")
        Image.fromarray(image).save(path, quality=JPEG_QUALITY, optimize=True)
        return self._picture(path, alt)

    def film_strip(self, name: str, tiles: Sequence[RgbImage], alt: str) -> Picture:
        """All tiles in one JPEG."""
        return self.photo(name, film_grid(tiles), alt)

    def animation(self, name: str, tiles: Sequence[RgbImage], alt: str) -> Picture:
        """The tiles one after the other, in a GIF."""
        path = self._path(f"{name}.gif")
        write_gif(path, tiles)
        return self._picture(path, alt)

    def chart(self, name: str, draw: Draw, alt: str) -> Picture:
        """A PNG for light pages and one for dark ones."""
        light, dark = (self._path(f"{name}-{theme.name}.png") for theme in THEMES)
        for theme, path in zip(THEMES, (light, dark), strict=True):
            save(draw(theme), path)
        return self._picture(light, alt, dark)

    def _path(self, file_name: str) -> Path:
        return self._report / IMAGES / file_name

    def _picture(self, path: Path, alt: str, dark: Path | None = None) -> Picture:
        with Image.open(path) as image:
            width, height = image.size
        return Picture(f"{IMAGES}/{path.name}", alt, width, height, None if dark is None else f"{IMAGES}/{dark.name}")
