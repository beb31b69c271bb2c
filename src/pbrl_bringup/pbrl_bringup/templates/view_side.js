// Beside the picture, in words: where things are now, what the marks mean, what is missing.

function node(tag, kind, text) {
  const made = document.createElement(tag);
  if (kind) made.className = kind;
  if (text !== undefined) made.textContent = text;
  return made;
}

// A row an object; returns a function that writes where they are at a time.
function makeNow(body, data, streams, centre) {
  body.replaceChildren();
  const rows = data.objects.map((object, i) => {
    const row = node("tr"), name = node("button", `chip ${colour(i)}`, object.name), where = node("td", "where");
    name.type = "button";
    name.title = "show it in the middle";
    name.addEventListener("click", () => centre(i));
    const head = node("th");
    head.append(name);
    row.append(head, where);
    body.append(row);
    return where;
  });
  return (t) => data.objects.forEach((object, i) => {
    const pose = streams.pose("objects", i, t);
    const text = pose ? `${pose.x.toFixed(3)}, ${pose.y.toFixed(3)} m${pose.theta === null ? "" : `, ${((pose.theta * 180) / Math.PI).toFixed(1)}\u00b0`}` : "never seen";
    rows[i].textContent = pose && !pose.seen ? `${text} (not seen now)` : text;
  });
}

function makeLegend(parent, data) {
  const list = node("ul", "keys"), said = [];
  const has = (kind, text) => said.push([kind, text]);
  if (data.objects.some((each) => each.pose || each.outline.length)) has("dotted", "where it was first seen");
  if (data.grippers.length) has("hand", "gripper, and the horizontal force on what it holds; weight and bias are not removed");
  if (data.objects.some((each) => each.model && each.model.wheel)) has("cloud", "where a wheel or locked caster may be: draws, mean, 95 %");
  if (data.objects.some((each) => each.model && each.model.hinge)) has("cloud", "where a hinge may be: draws, mean, 95 %");
  if (data.regions.length) has("region", "place of what is left out; dashed: 95 % of its middle");
  if (data.residuals.length) has("lacks", "force that the model lacks, now and along the way");
  if (data.plans.length) has("planned", "plan");
  for (const [kind, text] of said) {
    const item = node("li");
    item.append(node("i", `mark ${kind}`), text);
    list.append(item);
  }
  parent.replaceChildren(list);
  for (const [i, object] of data.objects.entries()) {
    if (object.model) parent.append(node("p", `told ${colour(i)}`, `${object.name}: ${object.model.told}`));
  }
  for (const told of data.told || []) parent.append(node("p", "told", told));
}

function makeNotes(parent, data) {
  parent.replaceChildren();
  const missing = [];
  data.objects.forEach((object, i) => { if (!data.streams.objects[i]) missing.push(`${object.name}: no pose was recorded`); });
  data.grippers.forEach((gripper, i) => {
    if (!data.streams.wrenches[i]) missing.push(`${gripper.name}: no wrench was recorded`);
    if (!data.streams.grippers[i]) missing.push(`${gripper.name}: no pose of the gripper was recorded`);
  });
  const all = [...data.notes, ...missing];
  if (!all.length) return;
  parent.append(node("h2", "", "Mind"));
  const list = node("ul", "notes");
  for (const text of all) list.append(node("li", "", text));
  parent.append(list);
}
