"""The service over HTTP: routes, request and response schemas, problem+json."""
