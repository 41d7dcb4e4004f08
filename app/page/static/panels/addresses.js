// Where the server describes what is shown.

/** Where the robot is described that is shown: of a recorded game its own. */
export function robotAddress(store) {
  const record = store.get('record');
  return record === null ? '/robot.json' : `/games/${encodeURIComponent(record)}/robot.json`;
}
