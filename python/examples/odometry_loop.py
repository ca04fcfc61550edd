# SPDX-License-Identifier: BSD-3-Clause
"""The loop of a SLAM system of your own: images in, poses and a map out, frame by frame.

The images are simulated here; a camera driver or a folder of files serves as well.
"""

import cairn

session = cairn.simulate("desk", frames=15, rate_hz=10.0, texture_scale=0.5)
odometry = cairn.Odometry(session.camera)
for i in range(len(session)):
    frame = session[i]
    report = odometry.track(frame.timestamp_s, frame.rgb, frame.depth_m)
    if report.keyframe:
        print(f"frame {i}: keyframe, {report.landmarks} landmarks")
odometry.complete()

landmark_map = odometry.map(min_observations=2)
errors = cairn.evaluate_trajectory(odometry.trajectory(), session.trajectory)
print(landmark_map)
print(errors)
