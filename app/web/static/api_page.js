// The API's own documentation within the pages: Swagger UI from its installed package.

import { root } from "./api.js";

const answer = await fetch(`${root}/openapi.json`);
const text = (await answer.text()).replaceAll("](ui/", `](${root}/ui/`); // its links are relative to /docs
window.SwaggerUIBundle({ spec: JSON.parse(text), dom_id: "#swagger-ui", deepLinking: true });
