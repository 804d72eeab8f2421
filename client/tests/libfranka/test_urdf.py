"""An arm by its URDF: a Research 3's file comes with franky-sim."""

import numpy as np
from franky_sim import FR3_URDF

from roboprompt_client.arms.panda import PandaGeometry
from roboprompt_client.arms.urdf import UrdfGeometry

DOWN = np.array([1.0, 0, 0, 0])
BARE = PandaGeometry("fr3", np.eye(4))


def test_a_research_3_s_file_says_what_our_geometry_says():
    geometry = UrdfGeometry(FR3_URDF, "link8")
    for position_m in ([0.4, 0.2, 0.4], [0.5, -0.2, 0.3], [0.3, 0.0, 0.6]):
        joints, ours = (item.way(BARE.ready_rad, np.array(position_m), DOWN) for item in (geometry, BARE))
        np.testing.assert_allclose(joints, ours, atol=1e-3)
        assert geometry.nearest_limit(joints).joint == BARE.nearest_limit(ours).joint
