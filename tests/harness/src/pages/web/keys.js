// Every key, what it does, and the panel that lists them.

// Pixels of one press of an arrow key.
const STEP_PX = 12;
const FINE_PX = 1;
const SIDES = [['ArrowUp', 0, 1], ['ArrowDown', 0, -1], ['ArrowLeft', -1, 0], ['ArrowRight', 1, 0]];

// [keys as KeyboardEvent.key, with modifiers before; group; what it does; action, told whether its button was pressed; may
// be held down; its button]
export function table(page) {
  const { session } = page;
  const plot = () => page.plot();
  const arrows = ([modifier, group, what, run]) =>
    SIDES.map(([key, right, up], k) => [modifier + key, group, k === 0 ? what : null, () => run(right, up), true]);
  return [
    ['a', 'Proposals', 'accept all that are offered; the next are shown', () => session.accept(), false, 'accept'],
    ['x', 'Proposals', 'reject the one at the mouse or cursor', () => session.reject(), false, 'reject'],
    ['m', 'Proposals', 'mend: accept the one at the mouse or cursor and select it for changes', () => session.mend(), false, 'mend'],
    ['d', 'Proposals', 'discard: reject all that are offered', () => session.discard(), false, 'discard'],
    ['o', 'Proposals', 'offer them one by one, or all of a way together', () => page.together(), false, 'together'],
    ['k', 'Proposals', 'decide later; show the next', () => page.later(), false, 'next-proposal'],
    ['n', 'Drawing', 'begin a new track', () => session.begin(), false, 'new'],
    ['e', 'Drawing', 'draw on with the selected track', () => session.extend(), false, 'extend'],
    [' ', 'Drawing', 'put a point at the cursor; when not drawing, select what is there', () => page.pick(), false],
    ['g', 'Drawing', 'follow what is at the cursor to both sides: a way for the selected track, or a new one; at the beginning of a track, where it stood hidden', (button) => page.follow(button), false, 'follow'],
    ['h', 'Drawing', 'show where following would lead while the mouse rests, or not', () => page.looks(), false],
    ['Enter', 'Drawing', 'end the track that is drawn', () => session.finish(), false],
    ['Escape', 'Drawing', 'end drawing, deselect, clear the brush', () => page.escape(), false],
    ['Ctrl+z', 'Changes', 'undo', () => session.undo(), true, 'undo'],
    ['Ctrl+y', 'Changes', 'redo (also Ctrl+Shift+Z)', () => session.redo(), true, 'redo'],
    ['Ctrl+Shift+z', 'Changes', null, () => session.redo(), true],
    ['Delete', 'Changes', 'delete the selected point, or the track', () => session.remove(), false],
    ['Backspace', 'Changes', null, () => session.remove(), false],
    ['Shift+Delete', 'Changes', 'delete the selected track', () => session.removeTrack(), false, 'delete-track'],
    ['s', 'Changes', 'split the selected track at the cursor', () => page.split(), false, 'split'],
    ['(', 'Changes', 'cut off what the selected track has before the cursor', () => page.cut(false), false],
    [')', 'Changes', 'cut off what it has after the cursor', () => page.cut(true), false],
    ['j', 'Changes', 'join: remember this track; press again on the other', () => session.join(), false, 'join'],
    ['1', 'Changes', 'car, 2 van, 3 truck, 4 bus, 5 motorcycle, 6 bicycle, 7 pedestrian; of the proposal at the mouse, too; with neither, of new tracks', () => page.classify(0), false],
    ...[1, 2, 3, 4, 5, 6].map((k) => [String(k + 1), 'Changes', null, () => page.classify(k), false]),
    ['i', 'Changes', 'go to the id of the selected track', () => page.focusId(), false],
    ['PageDown', 'Selection', 'select the next track', () => session.selectNext(1), true],
    ['PageUp', 'Selection', 'select the previous track', () => session.selectNext(-1), true],
    [']', 'Points', 'select the next point of the track', () => session.selectPoint(1), true],
    ['[', 'Points', 'select the previous point', () => session.selectPoint(-1), true],
    ...[
      ['', 'Cursor', 'move the cursor', (right, up) => plot().moveCursor(right * STEP_PX, up * STEP_PX)],
      ['Alt+', 'Points', 'move the selected point', (right, up) => page.nudge(right * FINE_PX, up * FINE_PX)],
      ['Shift+', 'View', 'pan', (right, up) => page.pan(right, up)],
    ].flatMap(arrows),
    ['+', 'View', 'zoom in at the cursor (mouse: wheel; with Shift only up and down, with Alt only across)', () => plot().zoom(1.4), true],
    ['-', 'View', 'zoom out', () => plot().zoom(1 / 1.4), true],
    ['>', 'View', 'zoom in along the upright axis only', () => plot().zoom(1.4, [false, true]), true],
    ['<', 'View', 'zoom out along the upright axis only', () => plot().zoom(1 / 1.4, [false, true]), true],
    ['0', 'View', 'show everything', () => page.showAll(), false],
    ['f', 'View', 'show the selected track, or the proposal', () => page.fit(), false],
    ['b', 'View', 'brush: only the reflections in this view count (mouse: Shift and drag); again for all', () => page.brush(), false],
    ['l', 'View', 'only the reflections in the lane of the selected track or the proposal, or all', () => session.lane(), false],
    ['c', 'View', 'colour by RCS or by track', () => page.colour(), false, 'colour'],
    ['.', 'Time', 'one radar frame on', () => session.step(1), true],
    [',', 'Time', 'one radar frame back', () => session.step(-1), true],
    ['t', 'Time', 'the cursor\'s time becomes the current one', () => page.timeHere(), false],
    ['p', 'Time', 'play or stop', () => page.play(), false, 'play'],
    ['w', 'Cursor', 'next plot: along, across, from above', () => page.nextPlot(), false],
    ['?', 'Help', 'this list', () => page.help(), false, 'help'],
  ].map(([key, group, what, run, repeats, button]) => ({ key, group, what, run, repeats, button }));
}

// What a key of a US keyboard writes, alone and with Shift, by KeyboardEvent.code.
const US = {
  Comma: ',<', Period: '.>', BracketLeft: '[{', BracketRight: ']}', Minus: '-_', Equal: '=+', Slash: '/?', Digit0: '0)',
  Digit1: '1!', Digit2: '2@', Digit3: '3#', Digit4: '4$', Digit5: '5%', Digit6: '6^', Digit7: '7&', Digit8: '8*', Digit9: '9(',
};

// Where the event does not tell the place of a key: letters of usual layouts, on the places of a to z.
const LAYOUTS = ['фисвуапршолдьтщзйкыегмцчня', 'αβψδεφγηιξκλμνοπ;ρστθωςχυζ'];

// What a key writes, on the place where a US keyboard has it if the layout has no Latin letters, or it is a dead key or an input method's.
function written({ key, code = '', shiftKey }) {
  const writesLatin = key.length === 1 && (key <= '~' || /\p{Script=Latin}/u.test(key));
  const isOther = key.length === 1 || ['Dead', 'Process', 'Unidentified'].includes(key);
  if (writesLatin || !isOther) return key;
  if (/^Key[A-Z]$/.test(code)) return code[3].toLowerCase();
  if (US[code]) return US[code][shiftKey ? 1 : 0];
  const places = LAYOUTS.map((letters) => letters.indexOf(key.toLowerCase())).filter((place) => place >= 0);
  return places.length > 0 ? String.fromCharCode(97 + places[0]) : key;
}

// The key of an event as the table writes it; letters do not depend on Caps Lock.
export function named(event) {
  const key = written(event);
  const letter = key.length === 1 && key !== key.toUpperCase() ? key : key.toLowerCase();
  const plain = key.length === 1 ? letter : key;
  // AltGr and Option write signs, and some systems tell them as Ctrl and Alt: what they write is meant
  const writesSign = event.altKey && !event.metaKey && plain.length === 1 && !/[a-z0-9 ]/.test(plain);
  const ctrl = (event.ctrlKey && !writesSign) || event.metaKey;
  const alt = event.altKey && !writesSign;
  const shift = event.shiftKey && (key.length > 1 || (event.ctrlKey && /[a-z]/.test(plain)));
  return `${ctrl ? 'Ctrl+' : ''}${alt ? 'Alt+' : ''}${shift ? 'Shift+' : ''}${plain}`;
}

// Carries out keys, except where text is written, and buttons that stand for one.
export function listen(page, keys = table(page)) {
  addEventListener('keydown', (event) => {
    if (document.querySelector('dialog[open]')) return;
    const writes = event.target.matches('input:not([type=range]), select');
    if (writes) {
      if (event.key === 'Escape') page.plot().element.focus();
      return;
    }
    // a button keeps its own keys, and a slider its arrows
    if (event.target.matches('button') && [' ', 'Enter'].includes(event.key)) return;
    if (event.target.matches('input[type=range]') && /^Arrow|^Page|^Home|^End/.test(event.key)) return;
    const entry = keys.find(({ key }) => key === named(event));
    if (!entry) return;
    event.preventDefault();
    if (!event.repeat || entry.repeats) entry.run(false);
  });
  for (const button of document.querySelectorAll('button[data-key]')) {
    const entry = keys.find((candidate) => candidate.button === button.dataset.key);
    button.title = `${entry.what} (${shown(entry.key)})`;
    button.setAttribute('aria-keyshortcuts', entry.key === ' ' ? 'Space' : entry.key);
    button.addEventListener('click', () => entry.run(true));
  }
  const list = document.getElementById('keys');
  for (const group of new Set(keys.map((entry) => entry.group))) {
    const title = document.createElement('h3');
    title.textContent = group;
    const rows = document.createElement('dl');
    for (const { key, what } of keys.filter((entry) => entry.group === group && entry.what !== null)) {
      const [term, meaning, cap] = ['dt', 'dd', 'kbd'].map((tag) => document.createElement(tag));
      cap.textContent = shown(key);
      meaning.textContent = what;
      term.append(cap);
      rows.append(term, meaning);
    }
    const section = document.createElement('section');
    section.append(title, rows);
    list.append(section);
  }
}

const shown = (key) => {
  const words = { ' ': 'Space', ArrowUp: '← ↑ → ↓', PageDown: 'Page down', PageUp: 'Page up', Escape: 'Esc' };
  const parts = key === '+' ? ['+'] : key.split('+');
  return parts.map((part) => words[part] ?? (part.length === 1 ? part.toUpperCase() : part)).join(' + ');
};
