// Light or dark: what the page has chosen (`data-theme` on the root), else what the system prefers.

const query = window.matchMedia('(prefers-color-scheme: dark)');

/** Whether the page is dark now. */
export function isDark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen === 'dark' || (chosen !== 'light' && query.matches);
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
