"""Thresholds that several packages share, so that `near`, `scattered` and `another way` mean the same in all."""

M_PER_RAD = 0.06  # 10 degrees of rotation weigh as much as 1 cm of position
GRASPED_M = 0.08  # a hand that closes within this of an object's position grasps it
BEYOND_NOISE_M = 0.08  # twice the scatter of rows under twice the paper's noise of poses
TURNED_M = 0.006  # least scatter (rms) along the wrong axes that counts; 6 degrees for rotations
WAY_SHARE = 1 / 3  # a larger share of the demonstrations is another way, not outliers
RARE_SHARE = 1 / 3  # of an instruction's demonstrations: a plan as rare is left out unless the scene calls for it
