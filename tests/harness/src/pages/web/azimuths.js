// Azimuths of a map: columns from right to left, those of one stretch narrower than the others. A unit is the width of a
// narrow one; where all are alike it is that of any.

const toUnits = ([first, end, times], place) => {
  const within = Math.min(Math.max(place, first), end) - first;
  return (place - within) * times + within;
};

const toPlace = ([first, end, times], unit) => {
  const within = Math.min(Math.max(unit - first * times, 0), end - first);
  return (unit - within) / times + within;
};

// Bearing of a place, from the sensor's heading: 0 is the right edge of the first azimuth, 0.5 its middle.
export function bearingOf({ azimuths, azimuth_rad: [right, left], narrow }, place) {
  return right + ((left - right) * toUnits(narrow, place)) / toUnits(narrow, azimuths);
}

// The azimuth of a bearing; -1 outside.
export function azimuthAt({ azimuths, azimuth_rad: [right, left], narrow }, bearing) {
  const azimuth = Math.floor(toPlace(narrow, ((bearing - right) / (left - right)) * toUnits(narrow, azimuths)));
  return azimuth >= 0 && azimuth < azimuths ? azimuth : -1;
}
