// SPDX-License-Identifier: Apache-2.0
// What the theme leaves out for those who use the keyboard or hear the page: the search has a name,
// places that scroll can be reached, and what is hidden cannot.
document.addEventListener("DOMContentLoaded", () => {
  document.querySelector("[data-md-component=search]")?.setAttribute("aria-label", "Search");
  for (const hidden of document.querySelectorAll("input[aria-hidden=true]")) hidden.tabIndex = -1;
  for (const box of document.querySelectorAll(".md-typeset__scrollwrap, .md-typeset pre > code")) {
    box.tabIndex = 0;
    box.setAttribute("role", "region");
    box.setAttribute("aria-label", box.matches("code") ? "Code" : "Table");
  }
});
