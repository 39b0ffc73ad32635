// All events of a page without a server come here: it is ready, a click, another choice.
// Given by Python: page (its parts), x, start, status, period, why, y (the packed lanes), words,
// reasons, none, untold, name, unit, orbits (a list of {slice, x, t, first, second, error}).
const parts = page
const lanes = x.length
let slice = 0
for (const select of parts.selects) {
  slice = slice * select.options.length + Number(select.value)
}
const event = cb_obj.event_name
const plain = (text) => text.replaceAll('_', ' ')
const about = (value) => `${name} = ${Number(value.toPrecision(7))}${unit === '' ? '' : ' ' + unit}`

function nearest(values, at) {
  let best = 0
  for (let i = 1; i < values.length; i++) {
    if (Math.abs(values[i] - at) < Math.abs(values[best] - at)) best = i
  }
  return best
}

function draw() {
  const first = start[slice * lanes], last = start[(slice + 1) * lanes]
  const columns = {
    x: new Float64Array(last - first), y: y.slice(first, last), bad: new Int32Array(last - first),
    status: new Int32Array(last - first), period: new Int32Array(last - first),
  }
  for (let lane = 0; lane < lanes; lane++) {
    const at = slice * lanes + lane
    for (let i = start[at] - first; i < start[at + 1] - first; i++) {
      columns.x[i] = x[lane]
      columns.bad[i] = status[at] === 0 ? 0 : 1
      columns.status[i] = status[at]
      columns.period[i] = period[at]
    }
  }
  parts.drawn.data = columns
}

function inWords(lane) {
  const at = slice * lanes + lane
  let said = none
  if (period[at] > 0) said = `period ${period[at]}`
  if (period[at] < 0) said = `${untold} (${plain(reasons[why[at]])})`
  return `${about(x[lane])}: ${said}, status ${plain(words[status[at]])}`
}

function choose(lane) {
  const at = slice * lanes + lane
  const points = Array.from(y.slice(start[at], start[at + 1]))
  const text = inWords(lane)
  parts.marker.location = x[lane]
  parts.chosen.text = text.replaceAll('&', '&amp;').replaceAll('<', '&lt;')
  parts.returns.title.text = `return map, ${text}`
  parts.return_points.data = {x: points.slice(0, -1), y: points.slice(1)}
  const finite = points.filter(Number.isFinite)
  const ends = finite.length > 0 ? [Math.min(...finite), Math.max(...finite)] : []
  parts.diagonal.data = {x: ends, y: ends}
  const here = orbits.filter((orbit) => orbit.slice === slice)
  if (here.length === 0) {
    parts.orbit.title.text = `points in order, ${text}`
    parts.orbit_points.data = {x: points.map((_, i) => i), y: points}
    return
  }
  const orbit = here[nearest(here.map((orbit) => orbit.x), x[lane])]
  const title = `computed at ${about(orbit.x)}, the nearest`
  parts.orbit.title.text = `orbit, ${title}`
  parts.plane.title.text = `phase plane, ${title}`
  parts.message.text = orbit.error
  parts.orbit_points.data = {x: orbit.t, y: orbit.first}
  const pair = orbit.second.length > 0
  parts.plane_points.data = {x: pair ? orbit.first : [], y: orbit.second}
}

if (event === 'tap' || event === 'doubletap') {
  choose(nearest(x, cb_obj.x))
} else {
  draw()
  const before = parts.marker.location
  choose(before === null ? Math.floor(lanes / 2) : nearest(x, before))
}
