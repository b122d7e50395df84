// A box is placed in the box around it by distances from its sides (left, right, front, rear, bottom, top), sizes
// (width, depth, height) and offsets of its centre (x, y, z). $width, $depth and $height are sizes of the box around.
module inside(left, right, width, x, front, rear, depth, y, bottom, top, height, z, tilt = 0) {
  box = in_box(left, right, width, x, front, rear, depth, y, bottom, top, height, z);
  size = [for (side = box) side[1] - side[0]];
  translate([for (side = box) side[0]]) rotate([-tilt, 0, 0])
    let ($width = size[0], $depth = size[1], $height = size[2]) children();
}

// The intervals of a box: [[left, right], [front, rear], [bottom, top]].
function in_box(left, right, width, x, front, rear, depth, y, bottom, top, height, z) = [
  span(left, right, width, x, $width, (1 / 2)), span(front, rear, depth, y, $depth, (1 / 2)),
  span(bottom, top, height, z, $height, 0)];

// An interval by its keywords in one of a length; the start of a size alone is a share of the free length.
function span(low, high, size, offset, full, share) =
  is_undef(size) ? [or_zero(low), full - or_zero(high)] :
  let (start = !is_undef(low) ? low : !is_undef(high) ? full - high - size :
    !is_undef(offset) ? (full - size) / 2 + offset : (full - size) * share) [start, start + size];

function or_zero(value) = is_undef(value) ? 0 : value;

// A point in the box around; undef along axes without a keyword.
function at(left, right, x, front, rear, y, bottom, top, z) =
  [side_at(left, right, x, $width), side_at(front, rear, y, $depth), side_at(bottom, top, z, $height)];

function side_at(low, high, offset, full) =
  !is_undef(low) ? low : !is_undef(high) ? full - high : is_undef(offset) ? undef : full / 2 + offset;

// The point with the coordinates of another where it has none.
function point(given, other) = [for (k = [0:2]) is_undef(given[k]) ? other[k] : given[k]];

function middle() = [$width / 2, $depth / 2, 0];

// A count, rounded half to even.
function count(n) = max(0, let (low = floor(n), rest = n - low)
  rest < 1 / 2 || (rest == 1 / 2 && low % 2 == 0) ? low : low + 1);

// The whole, whose bottom is at z = 0.
module whole(width, depth, height) {
  translate([-width / 2, -depth / 2, 0]) let ($width = width, $depth = depth, $height = height) children();
}

// The role of the children.
module part(role) { let ($role = role) children(); }

// The colour of the role, or else of the kind of solid.
module painted(kind) { color(colours[search([$role == "" ? kind : $role], colours)[0]][1]) children(); }

// n equal boxes along the axis "x", "y" or "z".
module divide(n, axis, gap = 0, left, right, width, x, front, rear, depth, y, bottom, top, height, z, tilt = 0) {
  inside(left, right, width, x, front, rear, depth, y, bottom, top, height, z, tilt) slices(count(n), search(axis, "xyz")[0], gap) children();
}

module slices(n, axis, gap) {
  size = ([$width, $depth, $height][axis] + gap) / n - gap;
  if (size > 0) for (i = [0 : 1 : n - 1]) {
    low = [for (k = [0:2]) k == axis ? i * (size + gap) : undef];
    long = [for (k = [0:2]) k == axis ? size : undef];
    inside(left = low[0], width = long[0], front = low[1], depth = long[1], bottom = low[2], height = long[2])
      children();
  }
}

// The children and their mirror image; along several axes, all of them.
module mirrored(left, right, x, front, rear, y, bottom, top, z) {
  plane = at(left, right, x, front, rear, y, bottom, top, z);
  far = [for (k = plane) is_undef(k) ? 0 : 1];
  for (a = [0:far[0]], b = [0:far[1]], c = [0:far[2]])
    multmatrix([[1 - 2 * a, 0, 0, 2 * a * or_zero(plane[0])], [0, 1 - 2 * b, 0, 2 * b * or_zero(plane[1])],
      [0, 0, 1 - 2 * c, 2 * c * or_zero(plane[2])], [0, 0, 0, 1]]) children();
}

// Copies about a vertical axis, counter-clockwise as seen from above.
module rotated(n, left, right, x, front, rear, y, step) {
  centre = point(at(left = left, right = right, x = x, front = front, rear = rear, y = y), middle());
  for (i = [0 : 1 : count(n) - 1])
    translate(centre) rotate([0, 0, i * (is_undef(step) ? 360 / count(n) : step)]) translate(-centre) children();
}

module translated(n, x = 0, y = 0, z = 0) {
  for (i = [0 : 1 : count(n) - 1]) translate(i * [x, y, z]) children();
}

// Evenly spaced copies: the keywords place the last copy of the first box.
module row(n, first, left, right, x, front, rear, y, bottom, top, z) {
  target = at(left, right, x, front, rear, y, bottom, top, z);
  share = [is_undef(left) ? is_undef(right) ? 1 / 2 : 1 : 0, is_undef(front) ? is_undef(rear) ? 1 / 2 : 1 : 0,
    is_undef(bottom) ? is_undef(top) ? 1 / 2 : 1 : 0];
  step = [for (k = [0:2]) is_undef(target[k]) ? 0 :
    (target[k] - first[k][0] - share[k] * (first[k][1] - first[k][0])) / max(1, count(n) - 1)];
  for (i = [0 : 1 : count(n) - 1]) translate(i * step) children();
}

// A box; lean moves its top to the rear.
module box(left, right, width, x, front, rear, depth, y, bottom, top, height, z, tilt = 0, lean = 0) {
  inside(left, right, width, x, front, rear, depth, y, bottom, top, height, z, tilt) painted("box") {
    if (min($width, $depth, $height) > 0)
      multmatrix([[1, 0, 0, 0], [0, 1, lean / $height, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        cube([$width, $depth, $height]);
  }
}

// A box with rounded edges.
module cushion(left, right, width, x, front, rear, depth, y, bottom, top, height, z, edge, tilt = 0) {
  inside(left, right, width, x, front, rear, depth, y, bottom, top, height, z, tilt) painted("cushion") rounded([$width, $depth, $height], edge);
}

// A ball of polygons around a box, pulled apart.
module rounded(size, edge) {
  radius = min(edge, min(size) / 2);
  last = segments / 2 - 1;
  step = 360 / segments;
  fuller = 1 / cos(step / 2);
  if (min(size) > 0 && radius > 0) {
    points = [for (tilt = [step / 2:step:180], a = [step / 2:step:360])
      let (way = [-sin(tilt) * sin(a) * fuller, sin(tilt) * cos(a) * fuller, cos(tilt)])
        [for (n = [0:2]) size[n] / 2 + sign(way[n]) * (size[n] / 2 - radius) + way[n] * radius * fuller]];
    caps = [[for (j = [1:segments]) segments - j], [for (j = [0:segments - 1]) last * segments + j]];
    sides = [for (k = [0:last - 1], j = [0:segments - 1])
      let (a = k * segments + j, b = k * segments + (j + 1) % segments) [a, b, b + segments, a + segments]];
    polyhedron(points = points, faces = concat(caps, sides), convexity = 2);
  } else if (min(size) > 0) cube(size);
}

// The width and depth of an upright round solid, which has a radius, or the size of a box along x or y.
function round_size(left, right, width, x, front, rear, depth, y, radius) = !is_undef(radius) ? 2 * max(radius) :
  let (by_x = !is_undef(width) || !(is_undef(left) || is_undef(right)),
    by_y = !is_undef(depth) || !(is_undef(front) || is_undef(rear)),
    side = by_y && !by_x ? span(front, rear, depth, y, $depth, (1 / 2)) : span(left, right, width, x, $width, (1 / 2)))
  side[1] - side[0];

// The intervals of the box of an upright round solid.
function round_box(left, right, width, x, front, rear, depth, y, bottom, top, height, z, radius) =
  let (across = round_size(left, right, width, x, front, rear, depth, y, radius))
  in_box(left, right, across, x, front, rear, across, y, bottom, top, height, z);

// An upright round solid, by radius or by the size of its box; a taper has two radii, [bottom, top].
module upright(kind, left, right, width, x, front, rear, depth, y, bottom, top, height, z, radius, tilt = 0) {
  across = round_size(left, right, width, x, front, rear, depth, y, radius);
  inside(left, right, across, x, front, rear, across, y, bottom, top, height, z, tilt) painted(kind)
    between(middle(), [$width / 2, $depth / 2, $height], is_undef(radius) ? across / 2 : radius);
}

// A round rod between two points.
module rod(start, end, radius) {
  painted("rod") between(point(start, middle()), point(end, point(start, middle())), radius);
}

// A round rod between two points with a radius at both, [start, end].
module taper(start, end, radius) {
  painted("taper") between(point(start, middle()), point(end, point(start, middle())), radius);
}

// A round rod between two points, as a prism of the same volume as the true one.
module between(start, end, radius) {
  radii = is_list(radius) ? radius : [radius, radius];
  fuller = sqrt(2 * PI / segments / sin(360 / segments));
  along = end - start;
  height = norm(along);
  if (height > 0 && min(radii) >= 0 && max(radii) > 0) translate(start)
    rotate([0, acos(max(-1, min(1, along[2] / height))), atan2(along[1], along[0])])
      cylinder(h = height, r1 = radii[0] * fuller, r2 = radii[1] * fuller, $fn = segments);
}

// An upright box with two sizes across and a length along the third axis, turned about that, and brought onto the line
// between two points by the least rotation.
module bar(start, end, width, depth, height, turn = 0) {
  first = point(start, middle());
  last = point(end, first);
  along = last - first;
  main = is_undef(width) ? 0 : is_undef(depth) ? 1 : 2;
  axis = [for (k = [0:2]) k == main ? 1 : 0];
  size = [for (k = [0:2]) k == main ? norm(along) : [width, depth, height][k]];
  leaned = along[main] < 0 ? -along : along;
  across = cross(axis, leaned);
  if (min(size) > 0) painted("bar") translate((first + last) / 2)
    rotate(atan2(norm(across), leaned[main]), across) rotate(turn * axis) cube(size, center = true);
}

// A round rod along the circle from one point through a second to a third, at most as thick as fills the ring; its
// prisms have the volume of the true one.
module bent_rod(start, through, end, radius) {
  first = point(start, middle());
  last = point(end, first);
  centre = (first + last) / 2;
  half = norm(last - first) / 2;
  unit = (last - first) / (2 * half);
  beside = point(through, first) - centre;
  away = beside - (beside * unit) * unit;
  height = norm(away);
  rest = half * half - beside * beside;
  // How high the circle rises over its chord.
  rise = 2 * height * half * half / max(norm([2 * height * half, rest]) + rest, half * half / 1000000000);
  if (half > 0 && radius > 0) painted("bent_rod") {
    if (rise > half / 100000) {
      ring = (half * half + rise * rise) / (2 * rise);
      angle = 4 * atan2(rise, half);
      step = angle / segments;
      fuller = sqrt(2 * PI / segments / sin(360 / segments) * step * PI / 180 / sin(step));
      thick = min(min(radius, ring) * fuller, 9999 / 10000 * ring / cos(180 / segments));
      bulge = away / height;
      side = cross(bulge, unit);
      origin = centre + (rise - ring) * bulge;
      multmatrix([for (k = [0:2]) [bulge[k], unit[k], side[k], origin[k]]])
        rotate([0, 0, -angle / 2]) rotate_extrude(angle = angle, $fn = segments * 360 / angle)
          translate([ring, 0]) rotate(180 / segments) circle(r = thick, $fn = segments);
    } else between(first, last, radius);
  }
}
