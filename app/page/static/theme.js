// Light or dark before anything is drawn: an ordinary script, since modules wait until the page has been read.
(() => {
  let theme = 'auto';
  try {
    theme = JSON.parse(localStorage.getItem('touchmove.theme')) ?? 'auto';
  } catch {  // storage may be forbidden: then as the system has it
  }
  document.documentElement.dataset.theme = ['light', 'dark'].includes(theme) ? theme : 'auto';
})();
