"""The version of RoboPrompt: of service and client, which are released together."""

VERSION = "1.0.0"
