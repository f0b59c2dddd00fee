// Where the server's addresses begin: "/", or behind a proxy "/some/prefix/".

export const ROOT = new URL("../../", import.meta.url).pathname;
