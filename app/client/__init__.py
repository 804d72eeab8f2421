"""The robot's side: a client of the service, the Robot Protocol and the loop that ties them.

Imports nothing of the server: only `app.pipeline`, httpx, numpy and OpenCV.
"""
