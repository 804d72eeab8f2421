"""Each demonstration held against the others: what of it the skill would not have let one expect."""

from collections.abc import Sequence

import numpy as np

from app.pipeline.skill.choice import FLOOR_M, FLOOR_RAD, WIDTH_M, WIDTH_RAD
from app.pipeline.skill.density import USUAL, SceneDensity, Surprise
from app.pipeline.skill.evidence import posterior, two_sided_p
from app.pipeline.skill.fit import Plan
from app.pipeline.skill.rows import COORDINATES
from app.pipeline.skill.scene import Scene


def left_out(plan: Plan, most_p: float) -> list[Surprise]:
    """Return what of each recording's acts is less probable than `most_p` by the others, the least probable first.

    The predictive of a demonstration left out is a Student t (`evidence`); p is of the least of all coordinates.
    """
    found: list[Surprise] = []
    residuals = np.stack([plan.rows[k].residuals for k in plan.shown.acts])  # (R, 6, N)
    if residuals.shape[-1] < 3:
        return found
    for n, item in enumerate(plan.members):
        others = np.delete(residuals, n, axis=-1)
        kinds = (others[:, :3], FLOOR_M, WIDTH_M), (others[:, 3:], FLOOR_RAD, WIDTH_RAD)
        known = [posterior(of, floor, width) for of, floor, width in kinds]
        mean = np.concatenate([one.mean for one in known], axis=1)
        scale, dof = (np.concatenate(of, axis=1) for of in ([x.scale() for x in known], [x.dof for x in known]))
        p = np.minimum(two_sided_p(residuals[..., n] - mean, scale, dof) * mean.size, 1.0)
        r, c = np.unravel_index(int(p.argmin()), p.shape)
        if p[r, c] < most_p:
            usual = float(mean[r, c] - USUAL * scale[r, c]), float(mean[r, c] + USUAL * scale[r, c])
            name = f"{COORDINATES[c]} of row {plan.shown.acts[r]}"
            found.append(Surprise(item.id, name, float(residuals[r, c, n]), usual, float(p[r, c])))
    return sorted(found, key=lambda one: one.p)


def scenes_left_out(scenes: Sequence[Scene], ids: Sequence[str], most_p: float) -> list[Surprise]:
    """Return what of each recording's scene is less probable than `most_p` by the scenes of the others."""
    found = []
    for n, scene in enumerate(scenes if len(scenes) > 2 else ()):
        density = SceneDensity.learned([*scenes[:n], *scenes[n + 1 :]])
        for one in density.surprises(scene, np.inf)[:1]:
            p = min(one.p * len(density.coordinates), 1.0)  # the least of so many
            if p < most_p:
                found.append(one._replace(coordinate=f"{one.about} {one.coordinate}", about=ids[n], p=p))
    return sorted(found, key=lambda one: one.p)
