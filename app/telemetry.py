"""OpenTelemetry traces: a span for each request, below it one for each stage of a prediction and each SQL statement."""

from fastapi import FastAPI
from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
from opentelemetry.instrumentation.fastapi import FastAPIInstrumentor
from opentelemetry.instrumentation.sqlalchemy import SQLAlchemyInstrumentor
from opentelemetry.sdk.resources import Resource
from opentelemetry.sdk.trace import TracerProvider
from opentelemetry.sdk.trace.export import BatchSpanProcessor

from app.services import timing


def install_tracing(app: FastAPI, endpoint: str) -> TracerProvider:
    """Send traces to an OTLP collector; call `shutdown` of what is returned at the end.

    Args:
        endpoint: its HTTP address, e.g. ``http://127.0.0.1:4318``.
    """
    provider = TracerProvider(resource=Resource.create({"service.name": "roboprompt"}))
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter(endpoint=f"{endpoint.rstrip('/')}/v1/traces")))
    FastAPIInstrumentor.instrument_app(app, tracer_provider=provider, excluded_urls="healthz,readyz,metrics")
    SQLAlchemyInstrumentor().instrument(tracer_provider=provider)
    timing.trace_with(provider.get_tracer("roboprompt"))
    return provider
