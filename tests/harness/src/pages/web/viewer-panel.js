// The panels beside the map: the cell that was asked about, senders, events, counters.

const element = (id) => document.getElementById(id);

const STATES = ['unknown', 'invisible', 'visible'];
const CONDITIONS = {
  ok: 'its map is shown',
  waiting: 'silent or late: all of its map is unknown',
  'no map': 'heard, no map of it has come yet: all of it is unknown',
  'no header': 'heard, its header has not come yet: all of it is unknown',
  unusable: 'another version, or a map too large: all of it is unknown',
  conflict: 'two senders use this number: all of it is unknown',
};
// Why messages are not used.
const UNUSED = {
  protection: 'failed the protection',
  not_authentic: 'not authentic',
  late: 'late',
  epoch: 'first of an epoch, or of another',
  early: 'before their header or refresh',
  malformed: 'malformed',
};

// Fills a list of terms.
function define(list, rows) {
  list.replaceChildren(...rows.filter(([, what]) => what !== null && what !== undefined && what !== '').flatMap(([name, what]) => {
    const [term, text] = [document.createElement('dt'), document.createElement('dd')];
    term.textContent = name;
    text.textContent = what;
    return [term, text];
  }));
}

export function showCell(told, instant, name) {
  element('cell-none').hidden = told !== null;
  if (!told) {
    define(element('cell'), []);
    return;
  }
  const state = STATES[told.state & 3];
  const since = told.since_begin ? 'the first instant' : `${told.since_s.toFixed(1)} s${told.or_longer ? ' or longer' : ''}`;
  const obstacles = told.shadows.map((k) => {
    const { center: [x, y], size: [length, , height] } = instant.obstacles[k];
    return `obstacle at (${x.toFixed(0)}, ${y.toFixed(0)}) m, ${length.toFixed(1)} m long, ${height.toFixed(1)} m high`;
  });
  const shadow = obstacles.length > 0 ? obstacles.join('; ') : state === 'invisible' && told.age_ms === null && instant.obstacles.length > 0 ? 'none that moves: what stands, or the edge of the view' : '';
  define(element('cell'), [
    ['map', name],
    ['state', `${state}${told.state & 4 ? ', occupied' : ''}`],
    ['grade', `${told.grade} of 255`],
    ['p of detection', told.probability === null ? '' : `at least ${Math.floor(100 * told.probability)} %`],
    ['since', since],
    ['place', `${told.x_m.toFixed(1)}, ${told.y_m.toFixed(1)} m; ${told.range_m.toFixed(0)} m away, ${told.azimuth_deg.toFixed(1)}°`],
    ['sector’s age', told.age_ms === null ? '' : `${told.age_ms} ms`],
    ['in the shadow of', shadow],
    ['by the labels', told.hidden_by.map((k) => instant.boxes[k].name ?? 'a vehicle').join(', ') && `hidden by ${told.hidden_by.map((k) => instant.boxes[k].name ?? 'a vehicle').join(', ')}`],
    ['on it stands', told.stands_on === null ? '' : `${instant.boxes[told.stands_on].name ?? 'a vehicle'}${instant.boxes[told.stands_on].outcome ? ` (${instant.boxes[told.stands_on].outcome})` : ''}`],
  ]);
}

// A state's name as it is read: "BusOff" is "bus off".
const inWords = (name) => name.replace(/(?<=.)(?=[A-Z])/g, ' ').toLowerCase();
const stateOf = ({ state, reason }) => (reason === 'None' ? inWords(state) : `${inWords(state)} (${inWords(reason)})`);

export function showSenders(instant) {
  element('senders-section').hidden = instant.senders.length === 0;
  const ages = (sensor) => {
    const known = (instant.maps.find(({ name }) => name === `sensor ${sensor}`)?.ages_ms ?? []).filter((age) => age !== null);
    return known.length > 0 ? `${Math.min(...known)} to ${Math.max(...known)} ms` : 'none is known';
  };
  element('senders').replaceChildren(...instant.senders.map((sender) => {
    const box = document.createElement('div');
    box.className = 'sender';
    // what has not begun is not late
    const begun = instant.maps.some(({ name }) => name === `sensor ${sender.sensor}`);
    const condition = sender.condition === 'waiting' && !begun ? 'no map' : sender.condition;
    box.dataset.condition = condition;
    const title = document.createElement('p');
    title.textContent = `Sensor ${sender.sensor}: ${CONDITIONS[condition] ?? condition}`;
    const rows = document.createElement('dl');
    const { counters: c, status, header } = sender;
    const counted = (names) => Object.entries(names).filter(([name]) => c[name] > 0).map(([name, what]) => `${c[name]} ${what}`);
    // one that came again or out of sequence is used or refused like any other
    const byCounters = counted({ repeated: 'came again', out_of_sequence: 'came out of sequence' });
    define(rows, [
      ['epoch', sender.epoch],
      ['sectors’ ages', ages(sender.sensor)],
      ['messages', [`${c.accepted} used`, `${c.lost} lost`, ...byCounters].join(', ')],
      ['not used', counted(UNUSED).join(', ')],
      ['unit', status && `${stateOf(status)}, up ${status.uptime_s} s`],
      ['wire version', status?.wire_version],
      ['fingerprint', header && header.fingerprint.toString(16).toUpperCase().padStart(8, '0')],
    ]);
    box.append(title, rows);
    return box;
  }));
}

export function showEvents(events) {
  element('events-section').hidden = events.length === 0;
  element('events').replaceChildren(...events.slice(-200).reverse().map(({ time_s: time, text }) => {
    const [row, when] = [document.createElement('li'), document.createElement('time')];
    when.textContent = `${time.toFixed(1)} s `;
    row.append(when, text);
    return row;
  }));
}

export function showCounters(instant, about) {
  const { sample } = instant;
  const { labelled, source } = about;
  const outcomes = labelled ? ['tv', 'fv', 'ti', 'fi'].map((key) => [key.toUpperCase(), sample[key]]) : [];
  const detections = source === 'recording' ? [['detections', sample.detections], ['obstacles', instant.obstacles.length]] : [];
  const shares = ['visible', 'invisible', 'unknown'].map((key) => [key, `${(100 * sample[key]).toFixed(1)} %`]);
  const counted = instant.counters.map(([what, n]) => [source === 'recording' ? `left out: ${what}` : what, n]);
  define(element('counters'), [...shares, ...detections, ...outcomes, ...counted]);
}

export function showNotes(about) {
  const lines = [...about.notes, ...about.problems];
  element('notes').replaceChildren(...lines.map((line) => Object.assign(document.createElement('li'), { textContent: line })));
}
