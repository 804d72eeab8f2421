// Server-sent events of an answer to POST, which the browser's EventSource cannot send.

/** Yields `{ event, data }` of a response's `text/event-stream` body, `data` read as JSON, as they arrive. */
export async function* events(response) {
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  try {
    while (true) {
      const { value, done } = await reader.read();
      if (done) return;
      rest += value.replaceAll("\r\n", "\n");
      const blocks = rest.split("\n\n");
      rest = blocks.pop();
      for (const block of blocks) {
        const read = parsed(block);
        if (read) yield read;
      }
    }
  } finally {
    reader.cancel().catch(() => {}); // the connection may be gone already
  }
}

function parsed(block) {
  let event = "message";
  const lines = [];
  for (const line of block.split("\n")) {
    const [, name, value] = /^(\w*):? ?(.*)$/.exec(line) ?? [];
    if (name === "event") event = value;
    if (name === "data") lines.push(value);
  }
  return lines.length ? { event, data: JSON.parse(lines.join("\n")) } : null;
}
