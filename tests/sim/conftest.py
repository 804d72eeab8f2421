# Chooses MuJoCo's OpenGL before any test module of this folder imports MuJoCo itself.
import app.sim  # noqa: F401
