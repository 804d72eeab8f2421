// A button that works once the number of chosen items is within `data-least` and `data-most` of its form.

for (const form of document.querySelectorAll("form[data-least]")) {
  const { least, most = Infinity } = form.dataset;
  const look = () => {
    const number = form.querySelectorAll("input[type=checkbox]:checked").length;
    for (const button of form.querySelectorAll("button")) button.disabled = number < least || number > most;
  };
  form.addEventListener("change", look);
  look();
}
