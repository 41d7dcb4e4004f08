/** A voice: the browser's own, off until somebody wants it. */

/**
 * Make the voice.
 * @param {import('../store.js').Store} store
 */
export function makeVoice(store) {
  const synthesis = window.speechSynthesis;
  let on = synthesis !== undefined && store.remembered('voice', false);

  /** Say a sentence after those before it; nothing where the voice is off. */
  function speak(sentence) {
    if (!on) return;
    const words = new SpeechSynthesisUtterance(sentence.replace(/['‘’"]/g, ''));
    words.lang = 'en';
    synthesis.speak(words);
  }

  /** Turn it on or off. */
  function turn(next) {
    on = next && synthesis !== undefined;
    store.remember('voice', on);
    if (!on) synthesis?.cancel();
    else speak('Voice on');
  }

  return {speak, turn, isOn: () => on, there: synthesis !== undefined};
}
