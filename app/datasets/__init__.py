"""Datasets that other tools recorded -> uploads, and stored episodes -> datasets. Files only: no service, no store."""
