"""The pages by subject; each reads the same services as the API, and writes only through the API, from scripts."""
