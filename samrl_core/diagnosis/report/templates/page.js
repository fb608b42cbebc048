(async () => {
  const text = id => document.getElementById(id).textContent;
  const plots = [...document.querySelectorAll('.plot')];
  const fail = why => plots.forEach(p => { p.classList.add('failed');
    p.textContent = 'This plot needs a newer browser (' + why + '). A picture beside this file shows the main one.'; });
  try {
    const packed = Uint8Array.from(atob(text('library').trim()), c => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('gzip'));
    const library = document.createElement('script');
    library.textContent = await new Response(stream).text();
    document.head.append(library);
  } catch (error) { return fail(error); }
  if (!window.Plotly) return fail('plotly did not start');
  const config = { responsive: true, displaylogo: false, displayModeBar: false, plotlyServerURL: '' };
  const draw = (element, id) => {
    const figure = JSON.parse(text(id));
    if (element.clientWidth < 560) {
      figure.layout.margin.l = 46; figure.layout.margin.r = 4;
      figure.layout.font.size = 11;
      figure.layout.dragmode = false;  // a finger on the plot scrolls the page
    }
    return Plotly.react(element, figure.data, figure.layout, config);
  };
  for (const element of plots) if (element.dataset.figure) draw(element, element.dataset.figure);

  const view = document.getElementById('overlay');
  if (view) {
    const index = JSON.parse(text('overlay-index'));
    const boxes = ['recording', 'joint', 'quantity'].map(key => document.getElementById('pick-' + key));
    const chosen = () => boxes.map(box => box.value);
    const caption = document.getElementById('overlay-caption');
    const show = entry => {
      boxes.forEach((box, k) => { box.value = entry.key[k]; });
      caption.textContent = entry.caption;
      draw(view, entry.id);
    };
    const nearest = changed => {
      const want = chosen();
      const weight = k => k === changed ? 10 : 1;
      const score = entry => entry.key.reduce((s, v, k) => s + (v === want[k] ? weight(k) : 0), 0);
      return index.reduce((best, entry) => score(entry) > score(best) ? entry : best);
    };
    boxes.forEach((box, k) => box.addEventListener('change', () => show(nearest(k))));
    show(index[0]);
  }
  // On a phone the heatmap is wider than the screen: show its hottest cell first.
  const hottest = document.querySelector('.heat [data-hottest]');
  if (hottest) {
    const frame = hottest.closest('.scroll');
    frame.scrollLeft = hottest.offsetLeft - 0.6 * frame.clientWidth;
  }
  const resize = () => plots.forEach(p => p.data && Plotly.Plots.resize(p));
  addEventListener('beforeprint', () => {
    document.querySelectorAll('details').forEach(d => { d.open = true; });
    resize();
  });
  addEventListener('afterprint', resize);
})();
