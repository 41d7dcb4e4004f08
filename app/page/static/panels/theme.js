// Light or dark: what the page has chosen (`data-theme` on the root), else what the system prefers.

const query = window.matchMedia('(prefers-color-scheme: dark)');

/** Whether the page is dark now. */
function isDark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen === 'dark' || (chosen !== 'light' && query.matches);
}

/** The colours that the names of `tokens.css` stand for now, by name, for what is painted and not styled. */
export function coloursNow(tokens) {
  const probe = document.body.appendChild(document.createElement('span'));
  const colourOf = (token) => {
    probe.style.color = `var(${token})`;
    return getComputedStyle(probe).color;
  };
  const colours = Object.fromEntries(tokens.map((token) => [token, colourOf(token)]));
  probe.remove();
  return colours;
}

/** Calls `changed(dark)` now and whenever that changes; returns what ends it. */
export function onTheme(changed) {
  const tell = () => changed(isDark());
  const observer = new MutationObserver(tell);
  observer.observe(document.documentElement, {attributes: true, attributeFilter: ['data-theme']});
  query.addEventListener('change', tell);
  tell();
  return () => {
    observer.disconnect();
    query.removeEventListener('change', tell);
  };
}
