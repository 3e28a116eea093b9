// Hands the blocks of TeX ("```math") to MathJax once it is loaded. Without a network they stay as they are: readable TeX.
"use strict";
(function () {
  let tries = 0;
  const timer = setInterval(function () {
    tries += 1;
    if (window.MathJax && window.MathJax.Hub) {
      clearInterval(timer);
      for (const code of document.querySelectorAll("code.language-math")) {
        const formula = document.createElement("div");
        formula.textContent = "\\[" + code.textContent + "\\]";
        code.parentElement.replaceWith(formula);
        window.MathJax.Hub.Queue(["Typeset", window.MathJax.Hub, formula]);
      }
    } else if (tries > 100) {
      clearInterval(timer);
    }
  }, 200);
})();
