"""Do findings tell predictions that will fail from those that will succeed? `python -m benchmarks.findings`."""
