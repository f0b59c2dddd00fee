// Swagger UI on the server's own description of its API.

SwaggerUIBundle({ url: "openapi.json", dom_id: "#docs", deepLinking: true });
