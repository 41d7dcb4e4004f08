// Who looks at what: a panel that nobody sees costs neither drawing nor telemetry nor pictures.

/** Calls `changed(seen)` whenever an element comes into sight or leaves it; returns what ends that. */
export function whileSeen(element, changed) {
  let near = false;
  let seen = false;
  const look = () => {
    const now = near && document.visibilityState === 'visible';
    if (now !== seen) changed((seen = now));
  };
  const observer = new IntersectionObserver((entries) => {
    near = entries[entries.length - 1].isIntersecting;
    look();
  });
  observer.observe(element);
  document.addEventListener('visibilitychange', look);
  return () => {
    observer.disconnect();
    document.removeEventListener('visibilitychange', look);
    near = false;
    look();
  };
}

/** Asks the server for a stream while an element is seen, and calls `changed(seen)`; returns what ends that. */
export function watchWhileSeen(element, store, stream, changed) {
  let stop = null;
  return whileSeen(element, (seen) => {
    if (seen) stop = store.watch(stream);
    else stop?.();
    changed(seen);
  });
}
