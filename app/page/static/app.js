/** Entry of the page: the store, the connection, and the parts of the page, the heavy ones when they are first opened. */

import {connect} from './connection.js';
import {createStore} from './store.js';
import {mountPanels} from './panels.js';

const store = createStore();
mountPanels(store);
connect(store);
