/**
 * The state of the page: one newest value for each section, and who wants to know when it changes.
 *
 * Sections that the server sends are those of docs/page.md ("session", "game", "clock", …). Besides them stand sections of
 * this browser's own: "connection" ("connecting", "open" or "away"), "telemetry" (the newest frame), "refused" (a sentence),
 * "viewing" (how many plies of the game the board shows; null: the newest position), "sent" (the newest line sent),
 * "record" (which recorded game is shown; null: none).
 */

/** @typedef {ReturnType<typeof createStore>} Store */

/**
 * Make the page's store.
 * @param {Storage} storage holds what this browser is to remember.
 */
export function createStore(storage = window.localStorage) {
  const values = new Map();
  const listeners = new Map();
  const watched = {telemetry: 0, camera: 0, film: 0};
  let transport = null;

  function get(section) {
    return values.get(section) ?? null;
  }

  /**
   * Call back with a section's value: at once where there is one, and whenever it changes. Returns a function that ends it.
   * @param {string} section
   * @param {(value: any) => void} callback
   */
  function subscribe(section, callback) {
    if (!listeners.has(section)) listeners.set(section, new Set());
    listeners.get(section).add(callback);
    if (values.has(section)) callback(get(section));
    return () => listeners.get(section).delete(callback);
  }

  /** Several sections at once: sets all of them before anybody hears of it. */
  function change(changes) {
    for (const [section, value] of Object.entries(changes)) values.set(section, value);
    for (const section of Object.keys(changes)) {
      for (const callback of [...(listeners.get(section) ?? [])]) callback(get(section));
    }
  }

  /** Set a section. */
  function set(section, value) {
    change({[section]: value});
  }

  /** Send a frame; true: it has been handed to the connection, false: there is none. */
  function send(frame) {
    return transport?.(frame) ?? false;
  }

  /** Say a line, as if typed at the terminal; true: it was sent. */
  function say(text) {
    if (!send({type: 'line', text})) {
      set('refused', 'There is no connection to the game: nothing was sent');
      return false;
    }
    set('sent', {text, at: performance.now()});
    return true;
  }

  /**
   * Ask for what is only sent while somebody looks: 'telemetry', 'camera' or 'film'. Returns a function that ends it.
   * @param {'telemetry' | 'camera' | 'film'} what
   */
  function watch(what) {
    watched[what] += 1;
    sendWatch();
    let over = false;
    return () => {
      if (over) return;
      over = true;
      watched[what] -= 1;
      sendWatch();
    };
  }

  function sendWatch() {
    const {telemetry, camera, film} = watched;
    send({type: 'watch', telemetry: telemetry > 0, camera: camera > 0, film: film > 0});
  }

  /** Where frames go; the connection calls this when it opens (and with null when it is lost). */
  function attach(next) {
    transport = next;
    if (next !== null && Object.values(watched).some((count) => count > 0)) sendWatch();
  }

  /** Whether this browser holds the controls of a program that runs. */
  function holds() {
    const controls = get('controls');
    return get('connection') === 'open' && get('session')?.live !== false &&
      controls !== null && controls.you === controls.holder;
  }

  /** What this browser remembers under a name, or what to take where it remembers nothing. */
  function remembered(name, otherwise) {
    try {
      const text = storage.getItem(`touchmove.${name}`);
      return text === null ? otherwise : JSON.parse(text);
    } catch {  // storage may be forbidden, and others may have written there
      return otherwise;
    }
  }

  /** Remember something in this browser. */
  function remember(name, value) {
    try {
      storage.setItem(`touchmove.${name}`, JSON.stringify(value));
    } catch {  // where storage is forbidden it lasts as long as the page
    }
  }

  return {get, subscribe, change, set, send, say, watch, attach, holds, remembered, remember};
}
