// Every call of the service's API from the pages, and its problems in words.

export const root = document.documentElement.dataset.root;

/** What the service refused, as its application/problem+json says it. */
export class ProblemError extends Error {
  constructor(problem) {
    super(problem.detail || problem.title);
    this.problem = problem;
  }
}

/**
 * Send a request; the answer, whose body is not read yet.
 * Throws ProblemError, also where the service cannot be reached. An aborted request throws as fetch does.
 */
export async function send(path, { headers = {}, json, ...options } = {}) {
  const all = new Headers(headers);
  if (json !== undefined) {
    all.set("Content-Type", "application/json");
    options.body = JSON.stringify(json);
  }
  let response;
  try {
    response = await fetch(root + path, { ...options, headers: all });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new ProblemError({ title: "The service cannot be reached", detail: "No answer: is it running?", status: 0 });
  }
  if (!response.ok) throw new ProblemError(await problemOf(response));
  return response;
}

/** The JSON document that a request is answered with; null for an empty answer. */
export async function call(path, options) {
  const response = await send(path, options);
  return response.status === 204 ? null : response.json();
}

async function problemOf(response) {
  try {
    return { title: response.statusText, errors: [], ...(await response.json()) };
  } catch {
    return { title: "The service failed", detail: `It answered ${response.status} without a reason.`, errors: [] };
  }
}
