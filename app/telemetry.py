"""OpenTelemetry traces: a span for each request, and below it one for each stage of a prediction."""

import requests
from fastapi import FastAPI
from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
from opentelemetry.instrumentation.fastapi import FastAPIInstrumentor
from opentelemetry.sdk.resources import Resource
from opentelemetry.sdk.trace import TracerProvider
from opentelemetry.sdk.trace.export import BatchSpanProcessor

from app.services import measures
from roboprompt_client.http import is_own_machine


class Tracing:
    """Sends traces to an OTLP collector.

    Args:
        endpoint: its HTTP address, e.g. ``http://127.0.0.1:4318``.
    """

    def __init__(self, endpoint: str) -> None:
        self._provider = TracerProvider(resource=Resource.create({"service.name": "roboprompt"}))
        session = requests.Session()
        session.trust_env = not is_own_machine(endpoint)
        exporter = OTLPSpanExporter(endpoint=f"{endpoint.rstrip('/')}/v1/traces", session=session)
        self._provider.add_span_processor(BatchSpanProcessor(exporter))

    def install(self, app: FastAPI) -> None:
        """Trace `app` from now on."""
        urls = "healthz,readyz,metrics"
        FastAPIInstrumentor.instrument_app(app, tracer_provider=self._provider, excluded_urls=urls)
        measures.trace_with(self._provider.get_tracer("roboprompt"))

    def close(self) -> None:
        """Send what is left. Blocking: call it in a thread."""
        measures.trace_with(None)
        self._provider.shutdown()
