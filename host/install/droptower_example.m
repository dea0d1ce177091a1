% SPDX-License-Identifier: GPL-3.0-or-later
% A result and its samples, as "droptower run" writes them, in MATLAB or GNU Octave 7:
%   droptower_example('drop.json', 'drop.csv')
function droptower_example(json, csv)
  result = jsondecode(fileread(json));
  file = fopen(csv);
  names = strsplit(fgetl(file), ',');
  numbers = numel(names) - 2;  % the last two columns are text
  cells = textscan(file, [repmat('%f', 1, numbers) '%*[^\n]'], 'Delimiter', ',', 'EmptyValue', NaN);
  fclose(file);
  fprintf('dropped %s by %s\n', result.origin.date, result.origin.operator);
  for k = 1:numel(result.channels)
    channel = result.channels(k);
    if iscell(channel), channel = channel{1}; end
    column = cells{strcmp(names, [channel.name '_g'])};
    column = column(~isnan(column));
    fprintf('%s peak %.3f g, %d samples, from %.5f to %.5f g\n', channel.name, channel.peak.value_g, ...
            numel(column), min(column), max(column));
  end
end
