// A closed row cannot be read on paper: open the checks for printing, and the row a link points to.
addEventListener("beforeprint", () => document.querySelectorAll("details.check, details.group").forEach(d => d.open = true));
const reveal = () => { const d = location.hash && document.getElementById(location.hash.slice(1));
  for (let e = d && d.closest("details"); e; e = e.parentElement.closest("details")) e.open = true;
  if (d && d.matches("details")) d.scrollIntoView(); };
addEventListener("hashchange", reveal); reveal();
if (matchMedia("(max-width: 1000px)").matches) document.querySelector("nav details").open = false;
