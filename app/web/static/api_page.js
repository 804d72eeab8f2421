// Swagger UI, from its installed package.

import { root } from "./api.js";

window.SwaggerUIBundle({ url: `${root}/openapi.json`, dom_id: "#swagger-ui", deepLinking: true });
