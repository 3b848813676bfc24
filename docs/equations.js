// Typesets what Markdown marked as an equation, with the KaTeX (0.19.1, MIT) that is served with the site.
for (const equation of document.querySelectorAll(".arithmatex")) {
  const displayMode = equation.tagName === "DIV";
  const source = equation.textContent.trim().slice(2, -2); // without \( \) or \[ \]
  katex.render(source, equation, { displayMode, throwOnError: false });
}
