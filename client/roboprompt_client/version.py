"""The version of RoboPrompt: of service and client, which are released together."""

VERSION = "2.0.0"
